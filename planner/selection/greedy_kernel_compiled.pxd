# Types of greedy_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

@cython.locals(at=whole, count=whole, row=whole, size=whole, unmet=whole)
cpdef whole choose(
    whole until_met, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, index[::1] left, whole[::1] wanted,
    whole[::1] needed, whole[::1] keys, whole[::1] heap, whole[::1] sums, whole[::1] touched,
    whole[::1] chosen
) noexcept nogil

cdef whole next_unmet(whole begin, whole[::1] needed) noexcept nogil

@cython.locals(k=whole)
cdef whole is_before(whole a, whole b, whole[::1] keys) noexcept nogil

@cython.locals(child=whole, row=whole)
cdef void sink(whole at, whole size, whole[::1] keys, whole[::1] heap) noexcept nogil

@cython.locals(k=whole, many=whole, first=whole, second=whole, total=whole, whole_gain=whole)
cdef void evaluate(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const index[::1] left, whole[::1] wanted,
    whole[::1] needed, whole[::1] keys, whole[::1] sums, whole[::1] touched
) noexcept nogil

@cython.locals(at=whole, entry=whole, many=whole)
cdef whole add(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const index[::1] left, whole[::1] sums,
    whole[::1] touched
) noexcept nogil

@cython.locals(at=whole, column=whole, entry=whole, k=whole, many=whole)
cdef void take(
    whole row, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, index[::1] left, whole[::1] wanted,
    whole[::1] needed, whole[::1] sums, whole[::1] touched
) noexcept nogil
