# Types of worth_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

@cython.locals(column=whole, entry=whole, k=whole)
cpdef void add_worth(
    const whole[::1] columns, const whole[::1] adds_first, const whole[::1] demand, const whole[::1] worth,
    whole[::1] sums
) noexcept nogil

@cython.locals(at=whole, begin=whole, column=whole, entry=whole, k=whole, to=whole, value=whole)
cpdef void add_worth_by_row(
    const whole[::1] columns, const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] place, whole rows, whole[::1] sums
) noexcept nogil

@cython.locals(at=whole, begin=whole, entry=whole, row=whole)
cpdef void add_worth_of_rows(
    whole low, whole high, const whole[::1] row_first, const index[::1] seen, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, whole demands, whole[::1] sums
) noexcept nogil

@cython.locals(at=whole, row=whole)
cpdef void count_runs(
    const whole[::1] row_first, const index[::1] seen, index[::1] last, whole[::1] many
) noexcept nogil

@cython.locals(at=whole, column=whole, row=whole)
cpdef void note_runs(
    const whole[::1] row_first, const index[::1] seen, index[::1] last, whole[::1] place, index[::1] run
) noexcept nogil

@cython.locals(at=whole, column=whole, entry=whole, k=whole)
cpdef void count_views(
    const whole[::1] rows, whole step, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] adds_first, const whole[::1] demand, const whole[::1] worth,
    const whole[::1] asks, whole[::1] covered, whole[::1] reached
) noexcept nogil

@cython.locals(column=whole, entry=whole, k=whole, total=whole)
cpdef void take_gain(
    const whole[::1] columns, const whole[::1] covered, const whole[::1] asks, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] short, const whole[::1] missing,
    whole[::1] sums, whole[::1] gains
) noexcept nogil

@cython.locals(at=whole, row=whole, total=double)
cpdef void sum_by_row(
    const whole[::1] row_first, const index[::1] seen, const double[::1] value, double[::1] sums
) noexcept nogil

@cython.locals(at=whole, k=whole)
cpdef void add_views(
    const whole[::1] rows, const whole[::1] row_first, const index[::1] seen, whole[::1] views
) noexcept nogil
