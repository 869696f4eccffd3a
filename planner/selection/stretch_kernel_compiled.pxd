# Types of stretch_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

@cython.locals(k=whole, row=whole, total=whole)
cpdef void count_columns(
    const whole[::1] run_first, const index[::1] begin, const index[::1] end, const index[::1] before,
    whole[::1] pointer
) noexcept nogil

@cython.locals(column=whole, k=whole, to=whole)
cpdef void note_columns(
    const index[::1] begin, const index[::1] end, const index[::1] before, index[::1] seen
) noexcept nogil
