# Types of tour_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
cdef whole QUEUE_HEAD, QUEUE_LENGTH, REVERSALS, LONGEST_SEGMENT, MOVE_REVERSALS

@cython.locals(gain=whole, k=whole, most=whole, point=whole, total=whole)
cpdef whole iterated_search(
    whole[::1] cost, whole[::1] near, whole[::1] order, whole[::1] position, whole[::1] trials,
    whole[::1] best, whole[::1] queue, whole[::1] waiting, whole[::1] journal, whole[::1] state
) noexcept nogil

cdef whole on_ring(whole index, whole n) noexcept nogil

@cython.locals(k=whole)
cdef void copy_tour(whole[::1] order, whole[::1] best) noexcept nogil

cdef void enqueue(whole point, whole[::1] queue, whole[::1] waiting, whole[::1] state) noexcept nogil

@cython.locals(gain=whole, most=whole, point=whole, total=whole)
cdef whole improve(
    whole[::1] cost, whole[::1] near, whole[::1] order, whole[::1] position, whole[::1] queue,
    whole[::1] waiting, whole[::1] journal, whole[::1] state
) noexcept nogil

@cython.locals(
    ab=whole, ac=whole, b=whole, c=whole, d=whole, first=whole, gain=whole, k=whole, last=whole,
    n=whole, reach=whole, step=whole
)
cdef whole two_opt(
    whole a, whole[::1] cost, whole[::1] near, whole[::1] order, whole[::1] position, whole[::1] queue,
    whole[::1] waiting, whole[::1] journal, whole[::1] state
) noexcept nogil

@cython.locals(
    after=whole, before=whole, c=whole, d=whole, gain=whole, n=whole, saved=whole, size=whole,
    step=whole, z=whole
)
cdef whole or_opt(
    whole a, whole[::1] cost, whole[::1] near, whole[::1] order, whole[::1] position, whole[::1] queue,
    whole[::1] waiting, whole[::1] journal, whole[::1] state
) noexcept nogil

@cython.locals(c=whole, d=whole, gain=whole, k=whole, n=whole, reach=whole, side=whole, spare=whole)
cdef (whole, whole, whole) best_gap(
    whole a, whole z, whole size, whole step, whole saved, whole[::1] cost, whole[::1] near,
    whole[::1] order, whole[::1] position
) noexcept nogil

@cython.locals(begin=whole, end=whole, first=whole, last=whole, left=whole, n=whole, right=whole)
cdef void move(
    whole a, whole z, whole c, whole d, whole step, whole[::1] order, whole[::1] position,
    whole[::1] journal, whole[::1] state
) noexcept nogil

@cython.locals(
    a=whole, at=whole, b=whole, c=whole, d=whole, far=whole, mid=whole, n=whole, p=whole, q=whole,
    removed=whole
)
cdef whole double_bridge(
    whole cut, whole[::1] cost, whole[::1] order, whole[::1] position, whole[::1] trials,
    whole[::1] queue, whole[::1] waiting, whole[::1] journal, whole[::1] state
) noexcept nogil

@cython.locals(n=whole)
cdef void turn_between(
    whole p, whole q, whole[::1] order, whole[::1] position, whole[::1] journal, whole[::1] state
) noexcept nogil

cdef void reverse(
    whole i, whole j, whole[::1] order, whole[::1] position, whole[::1] journal, whole[::1] state
) noexcept nogil

cdef void undo(whole[::1] order, whole[::1] position, whole[::1] journal, whole[::1] state) noexcept nogil

@cython.locals(_=whole, count=whole, n=whole, p=whole, q=whole)
cdef void swap_ends(whole i, whole j, whole[::1] order, whole[::1] position) noexcept nogil
