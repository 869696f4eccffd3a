# Types of tangent_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
cdef double SURELY

cdef whole turn(whole px, whole py, whole qx, whole qy, whole rx, whole ry) noexcept nogil

@cython.locals(one=double, other=double, to_back=whole, to_on=whole)
cdef bint cuts(
    whole along_x, whole along_y, whole back_x, whole back_y, whole on_x, whole on_y
) noexcept nogil

@cython.locals(
    a=whole, b=whole, count=whole, entry=whole, here=whole, k=whole, left=whole, many=whole, new_left=whole,
    new_right=whole, right=whole, row=whole, s=whole, seen=bint, there=whole, to_left=whole, to_right=whole, top=whole,
    triangle=whole, x=whole, y=whole
)
cpdef whole pieces(
    whole first_row, whole all_round, const whole[::1] viewer, const whole[::1] at_x,
    const whole[::1] at_y, const whole[::1] start_first, const whole[::1] start,
    const whole[::1] start_right, const whole[::1] start_left, const whole[::1] vx, const whole[::1] vy,
    const whole[::1] corner, const whole[::1] neighbour, const whole[::1] node,
    const whole[::1] back_x, const whole[::1] back_y, const whole[::1] on_x, const whole[::1] on_y,
    const whole[::1] item_first, const whole[::1] item, whole[::1] pointer, whole[::1] stack,
    whole[::1] out
) noexcept nogil

cdef bint between(
    whole px, whole py, whole rx, whole ry, whole qx, whole qy, whole lx, whole ly
) noexcept nogil

@cython.locals(back=whole)
cdef whole enter(
    whole beyond, whole first, whole right, whole left, whole top, const whole[::1] corner,
    whole[::1] stack
) noexcept nogil
