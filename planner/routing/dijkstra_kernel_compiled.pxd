# Types of dijkstra_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(
    edge=whole, here=whole, many=whole, size=whole, there=whole, total=double, ways=whole
)
cpdef whole reach(
    whole source, whole target, whole points, whole wanted, const whole[::1] first, const whole[::1] to,
    const double[::1] length, double[::1] away, whole[::1] before, whole[::1] closed, whole[::1] touched,
    double[::1] key, whole[::1] item, whole[::1] found, double[::1] found_away
) noexcept nogil

@cython.locals(k=whole)
cdef void forget(
    whole ways, const whole[::1] touched, double[::1] away, whole[::1] closed
) noexcept nogil

@cython.locals(at=whole)
cdef whole push(whole size, double value, whole node, double[::1] key, whole[::1] item) noexcept nogil

@cython.locals(at=whole, below=whole, node=whole, value=double)
cdef whole pop(whole size, double[::1] key, whole[::1] item) noexcept nogil

cdef double MOST

@cython.locals(edge=whole, here=whole, left=whole, size=whole, there=whole, total=double)
cpdef void find_lengths(
    whole source, whole points, const whole[::1] first, const whole[::1] to, const double[::1] length,
    double[::1] away, whole[::1] queue, whole[::1] place
) noexcept nogil

@cython.locals(edge=whole, here=whole, size=whole, there=whole, total=double)
cpdef double grow(
    whole source, double limit, whole wanted, const whole[::1] group, const whole[::1] first,
    const whole[::1] to, const double[::1] length, double[::1] away, whole[::1] before, whole[::1] queue,
    whole[::1] place, whole[::1] met
) noexcept nogil

@cython.locals(at=whole)
cdef void rise(whole node, const double[::1] away, whole[::1] queue, whole[::1] place) noexcept nogil

@cython.locals(at=whole, below=whole, best=whole)
cdef void sink(
    whole node, whole size, const double[::1] away, whole[::1] queue, whole[::1] place
) noexcept nogil
