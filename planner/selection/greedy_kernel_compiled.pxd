# Types of greedy_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

@cython.locals(at=whole, count=whole, row=whole, size=whole)
cpdef whole choose(
    whole until_met, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] covered,
    whole[::1] wanted, whole[::1] needed, whole[::1] keys, whole[::1] heap, whole[::1] sums,
    whole[::1] chosen
) noexcept nogil

@cython.locals(k=whole)
cdef whole any_unmet(whole[::1] needed) noexcept nogil

@cython.locals(k=whole)
cdef whole is_before(whole a, whole b, whole[::1] keys) noexcept nogil

@cython.locals(child=whole, row=whole)
cdef void sink(whole at, whole size, whole[::1] keys, whole[::1] heap) noexcept nogil

@cython.locals(at=whole, entry=whole, first=whole, second=whole, total=whole, whole_gain=whole)
cdef void evaluate(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] covered,
    whole[::1] wanted, whole[::1] needed, whole[::1] keys, whole[::1] sums
) noexcept nogil

@cython.locals(at=whole, entry=whole)
cdef void add(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] covered,
    whole[::1] sums
) noexcept nogil

@cython.locals(at=whole, column=whole, entry=whole)
cdef void take(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] covered,
    whole[::1] wanted, whole[::1] needed, whole[::1] sums
) noexcept nogil
