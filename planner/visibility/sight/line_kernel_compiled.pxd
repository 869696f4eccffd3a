# Types of line_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

cdef whole SPLIT, LOW, LEFT, RIGHT, BOTH
cdef double DOUBT

@cython.locals(
    ax=whole, ay=whole, bx=whole, by=whole, k=whole, known=whole, rest=whole, to_x=whole, to_y=whole,
    unit=whole
)
cpdef void mark_seen(
    whole x, whole y, whole reach, const whole[::1] chosen, const whole[::1] a, const whole[::1] b,
    const whole[::1] odd, const whole[::1] pieces, const signed char[::1] face, const whole[::1] edges,
    const whole[::1] near, const double[::1] away, whole[::1] hidden_by, signed char[::1] seen
) noexcept nogil

@cython.locals(found=whole, length=double, place=whole, sides=whole)
cdef whole first_hider(
    whole x, whole y, whole to_x, whole to_y, whole pieces, const whole[::1] edges, const whole[::1] near,
    const double[::1] away
) noexcept nogil

@cython.locals(
    beyond=double, doubt=double, end=double, end_doubt=double, end_x=double, end_y=double, from_x=double,
    from_y=double, minus=double, near=double, near_doubt=double, plus=double, start=double,
    start_doubt=double
)
cdef whole blocked(
    whole x, whole y, whole to_x, whole to_y, whole pieces, const whole[::1] edges, whole at
) noexcept nogil

@cython.locals(
    end=whole, end_high=whole, end_low=whole, found=whole, from_high=whole, from_low=whole, high=whole,
    low=whole, near=whole, start=whole
)
cdef whole blocked_exactly(
    whole to_x, whole to_y, whole pieces, whole from_x, whole from_y, whole end_x, whole end_y
) noexcept nogil

@cython.locals(high=whole, low=whole)
cdef (whole, whole) side(whole to_x, whole to_y, whole x, whole y) noexcept nogil

cdef whole sign(whole high, whole low) noexcept nogil

@cython.locals(
    high=whole, least=whole, low=whole, middle=whole, most=whole, x_high=whole, x_low=whole, y_high=whole,
    y_low=whole
)
cpdef bint within(whole x, whole y, whole limit) noexcept nogil
