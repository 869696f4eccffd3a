# Types of swap_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index
cdef whole NEVER
cdef whole ABOVE

@cython.locals(held=whole, k=whole, out=whole, place=whole, swap=whole)
cpdef whole repair(
    whole swaps, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] left, whole[::1] asked,
    whole[::1] weight, whole[::1] gain, whole[::1] chosen, whole[::1] free, whole[::1] tabu,
    whole[::1] place_of, whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] noted,
    whole[::1] regained, whole[::1] highest, whole[::1] common, whole[::1] found, whole[::1] open_
) noexcept nogil

cdef void exchange(
    whole place, whole into, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] left, whole[::1] asked,
    whole[::1] gain, whole[::1] chosen, whole[::1] free, whole[::1] place_of, whole[::1] counts,
    whole[::1] touched, whole[::1] lost, whole[::1] noted, whole[::1] regained, whole[::1] highest
) noexcept nogil

@cython.locals(demand=whole, first=whole, k=whole, least=whole, penalty=whole, row=whole, rows=whole, short=whole, unmet=whole)
cdef whole add_up(
    whole[::1] asked, whole[::1] weight, whole[::1] gain, whole[::1] free, whole[::1] common,
    whole[::1] found, whole[::1] open_
) noexcept nogil

@cython.locals(at=whole, first=whole, notes=whole, rows=whole, to=whole)
cdef void enter(
    whole row, whole place, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, whole[::1] left, whole[::1] place_of,
    whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] noted, whole[::1] regained
) noexcept nogil

@cython.locals(
    at=whole, entry=whole, first=whole, high=whole, k=whole, low=whole, notes=whole, rows=whole,
    to=whole, value=whole
)
cdef void change(
    whole column, whole place, whole most, whole loss, whole more, const whole[::1] run_first,
    const index[::1] run, const whole[::1] adds_first, const whole[::1] demand, const whole[::1] worth,
    whole[::1] place_of, whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] noted,
    whole[::1] regained
) noexcept nogil

@cython.locals(
    apart=whole, begin=whole, covered=whole, end=whole, first=whole, k=whole, opened=whole, row=whole,
    rows=whole, short=whole, total=whole, whole_at=whole
)
cdef void try_swaps(
    whole place, whole most, whole[::1] asked, whole[::1] weight, whole[::1] gain, whole[::1] chosen,
    whole[::1] counts, whole[::1] touched, whole[::1] lost, whole[::1] regained, whole[::1] highest,
    whole[::1] common, whole[::1] found, whole[::1] open_
) noexcept nogil

@cython.locals(at=whole, most=whole)
cdef whole most_of(whole[::1] gain, whole first, whole rows) noexcept nogil

@cython.locals(after=whole, before=whole, k=whole, rows=whole, total=whole)
cdef whole shortfall(
    whole row, whole opened, whole[::1] common, whole least, whole[::1] asked, whole[::1] weight,
    whole[::1] gain, whole[::1] regained, whole[::1] open_
) noexcept nogil

cdef whole is_better(whole place, whole covered, whole[::1] chosen, whole[::1] found) noexcept nogil

@cython.locals(
    at=whole, column=whole, entry=whole, k=whole, others=whole, rows=whole, seer=whole, short=whole, to=whole,
    value=whole
)
cdef void see(
    whole row, whole more, whole most, const whole[::1] row_first, const index[::1] seen,
    const whole[::1] run_first, const index[::1] run, const whole[::1] adds_first,
    const whole[::1] demand, const whole[::1] worth, const whole[::1] asks, whole[::1] left, whole[::1] asked,
    whole[::1] gain, whole[::1] place_of, whole[::1] counts, whole[::1] touched, whole[::1] lost,
    whole[::1] noted, whole[::1] regained, whole[::1] highest
) noexcept nogil
