# Types of swap_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index
cdef whole NEVER

@cython.locals(held=whole, into=whole, k=whole, out=whole, place=whole, swap=whole)
cpdef whole repair(
    whole swaps, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, whole[::1] left, whole[::1] asked,
    whole[::1] weight, whole[::1] gain, whole[::1] chosen, whole[::1] free, whole[::1] tabu,
    whole[::1] stale, whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] regained,
    whole[::1] common, whole[::1] found, whole[::1] where, whole[::1] open_
) noexcept nogil

@cython.locals(demands=whole, k=whole, row=whole, short=whole, total=whole, unmet=whole)
cdef whole add_up(
    whole[::1] asked, whole[::1] weight, whole[::1] gain, whole[::1] common, whole[::1] open_
) noexcept nogil

@cython.locals(at=whole, demands=whole, first=whole, k=whole, row=whole, rows=whole, to=whole)
cdef void leave(
    whole place, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, whole[::1] left, whole[::1] chosen,
    whole[::1] stale, whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] regained,
    whole[::1] where
) noexcept nogil

@cython.locals(entry=whole)
cdef whole lose(
    whole column, whole first, whole demands, const whole[::1] adds_first, const whole[::1] demand,
    const whole[::1] worth, whole[::1] left, whole[::1] touched, whole[::1] lost, whole[::1] where
) noexcept nogil

@cython.locals(begin=whole, entry=whole, high=whole, k=whole, low=whole, to=whole, value=whole)
cdef void regain(
    whole column, whole place, whole first, whole rows, const whole[::1] run_first, const index[::1] run,
    const whole[::1] adds_first, const whole[::1] demand, const whole[::1] worth, whole[::1] left,
    whole[::1] counts, whole[::1] regained, whole[::1] where
) noexcept nogil

@cython.locals(
    covered=whole, demands=whole, first=whole, k=whole, opened=whole, row=whole, rows=whole, total=whole,
    whole_at=whole
)
cdef void try_swaps(
    whole place, whole most, whole[::1] asked, whole[::1] weight, whole[::1] gain, whole[::1] chosen,
    whole[::1] free, whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] regained,
    whole[::1] common, whole[::1] found, whole[::1] open_
) noexcept nogil

@cython.locals(after=whole, before=whole, demands=whole, k=whole)
cdef whole shortfall(
    whole row, whole opened, whole total, whole least, whole[::1] asked, whole[::1] weight,
    whole[::1] gain, whole[::1] regained, whole[::1] open_
) noexcept nogil

cdef whole is_better(whole place, whole covered, whole[::1] chosen, whole[::1] found) noexcept nogil

@cython.locals(
    at=whole, column=whole, demands=whole, entry=whole, k=whole, seer=whole, short=whole, value=whole
)
cdef void see(
    whole row, whole more, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, whole[::1] left, whole[::1] asked,
    whole[::1] gain, whole[::1] stale
) noexcept nogil
