# Types of component_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

@cython.locals(components=whole, here=whole, link=whole, row=whole, size=whole, there=whole)
cpdef void label_components(
    const whole[::1] first, const index[::1] to, const whole[::1] inside, whole[::1] label, whole[::1] stack
) noexcept nogil

@cython.locals(count=whole, k=whole, link=whole)
cpdef whole find_neighbours(
    const whole[::1] first, const index[::1] to, const whole[::1] rows, unsigned char[::1] is_end,
    whole[::1] found
) noexcept nogil

@cython.locals(
    count=whole, growing=whole, here=whole, k=whole, link=whole, part=whole, parts=whole,
    there=whole, turns=whole,
)
cpdef whole grow_parts(
    const whole[::1] first, const index[::1] to, const whole[::1] inside, const whole[::1] seeds,
    whole[::1] label, whole[::1] parent, whole[::1] head, whole[::1] tail, whole[::1] turn,
    whole[::1] following, whole[::1] met
) noexcept nogil

@cython.locals(k=whole, parts=whole)
cdef whole plant(
    const whole[::1] inside, const whole[::1] seeds, whole[::1] label, whole[::1] parent,
    whole[::1] head, whole[::1] tail, whole[::1] turn, whole[::1] following, whole[::1] met
) noexcept nogil

cdef whole join(
    whole other, whole part, whole[::1] parent, whole[::1] head, whole[::1] tail,
    whole[::1] following
) noexcept nogil

cdef void append(
    whole part, whole begin, whole end, whole[::1] head, whole[::1] tail, whole[::1] following
) noexcept nogil

cdef whole root(whole part, whole[::1] parent) noexcept nogil
