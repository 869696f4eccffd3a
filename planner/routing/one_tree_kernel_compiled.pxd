# Types of one_tree_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(
    apart=whole, at=whole, before=whole, inside=whole, k=whole, last=whole, least=whole, link=whole,
    many=whole, n=whole, own=whole, point=whole, row=whole, total=whole
)
cpdef whole grow(
    const whole[::1] cost, const whole[::1] weight, whole[::1] away, whole[::1] parent, whole[::1] free,
    whole[::1] degree
) noexcept nogil

@cython.locals(
    apart=whole, first=whole, last=whole, n=whole, point=whole, row=whole, second=whole, total=whole
)
cdef whole close(const whole[::1] cost, const whole[::1] weight, whole[::1] degree) noexcept nogil

@cython.locals(count=whole, here=whole, k=whole, there=whole)
cpdef whole join_all(
    const whole[::1] order, const whole[::1] a, const whole[::1] b, whole[::1] joined, whole[::1] used
) noexcept nogil
