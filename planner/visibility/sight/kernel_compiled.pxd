# Types of kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
cdef whole HALF, HALF_MASK, THIRD, THIRD_MASK, NO_END, MOST_STEPS

cdef whole turn(whole px, whole py, whole qx, whole qy, whole rx, whole ry) noexcept nogil

cdef bint between(
    whole px, whole py, whole rx, whole ry, whole qx, whole qy, whole lx, whole ly
) noexcept nogil

@cython.locals(low=whole, rest=whole)
cpdef bint not_negative(whole at_a, whole at_b, whole odd, whole pieces) noexcept nogil

@cython.locals(
    far=whole, far_high=whole, far_low=whole, high=whole, low=whole, middle=whole, x=whole,
    x_high=whole, x_low=whole, y=whole, y_high=whole, y_low=whole
)
cpdef bint within_reach(
    whole ax, whole ay, whole bx, whole by, whole odd, whole pieces, whole reach
) noexcept nogil

@cython.locals(pieces=whole, guess=double, unit=whole)
cdef whole first_not_negative(whole at_a, whole at_b, whole units, whole low) noexcept nogil

@cython.locals(pieces=whole, guess=double, unit=whole)
cdef whole last_not_negative(whole at_a, whole at_b, whole units, whole high) noexcept nogil

cdef (whole, whole) clip_side(whole at_a, whole at_b, whole units, whole low, whole high) noexcept nogil

@cython.locals(
    above=whole, below=whole, first=whole, middle=whole, other=whole, pieces=whole, better=whole,
    nearest=whole, foot=double, ww=double, wx=double, wy=double
)
cdef (whole, whole) clip_reach(
    whole ax, whole ay, whole bx, whole by, whole units, whole reach, whole low, whole high
) noexcept nogil

@cython.locals(
    dx=double, dy=double, foot=double, from_t=double, la=double, lb=double, limit=double, ra=double,
    rb=double, t=double, to_t=double, wx=double, wy=double
)
cdef bint edge_too_far(
    whole qx, whole qy, whole ax, whole ay, whole bx, whole by, whole rx, whole ry, whole lx, whole ly,
    whole reach
) noexcept nogil

@cython.locals(
    a=whole, at_a=whole, at_b=whole, b=whole, back=whole, beyond=whole, count=whole, entry=whole,
    high=whole, item=whole, k=whole, left=whole, low=whole, n=whole, new_left=whole, new_right=whole,
    right=whole, s=whole, segment=whole, size=whole, to_right=whole, top=whole, triangle=whole, x=whole,
    y=whole
)
cdef whole look(
    whole row, whole begin, const whole[::1] qx, const whole[::1] qy, const whole[::1] start_pointer,
    const whole[::1] start_triangle, const whole[::1] start_right, const whole[::1] start_left,
    const whole[::1] vx, const whole[::1] vy, const whole[::1] corner, const whole[::1] neighbour,
    const whole[::1] face, const whole[::1] bucket_pointer, const whole[::1] bucket_segment,
    const whole[::1] bucket_low, const whole[::1] bucket_high, const whole[::1] ax, const whole[::1] ay,
    const whole[::1] bx, const whole[::1] by, const whole[::1] units, whole reach, whole[::1] stack,
    whole[::1] out_segment, whole[::1] out_low, whole[::1] out_high
) noexcept nogil

@cython.locals(end=whole, row=whole)
cpdef whole look_all(
    whole first_row, whole[::1] pointer, const whole[::1] qx, const whole[::1] qy,
    const whole[::1] start_pointer, const whole[::1] start_triangle, const whole[::1] start_right,
    const whole[::1] start_left, const whole[::1] vx, const whole[::1] vy, const whole[::1] corner,
    const whole[::1] neighbour, const whole[::1] face, const whole[::1] bucket_pointer,
    const whole[::1] bucket_segment, const whole[::1] bucket_low, const whole[::1] bucket_high,
    const whole[::1] ax, const whole[::1] ay, const whole[::1] bx, const whole[::1] by,
    const whole[::1] units, whole reach, whole[::1] stack, whole[::1] out_segment, whole[::1] out_low,
    whole[::1] out_high
) noexcept nogil

@cython.locals(cx=whole, cy=whole)
cdef whole most_turn(
    whole x0, whole y0, whole x1, whole y1, whole rx, whole ry, whole px, whole py
) noexcept nogil

@cython.locals(
    dx=double, dy=double, foot=double, from_t=double, limit=double, t=double, to_t=double, wx=double,
    wy=double
)
cdef bint part_too_far(
    whole x, whole y, whole ax, whole ay, whole bx, whole by, whole ra, whole rb, whole la, whole lb,
    whole reach
) noexcept nogil

@cython.locals(
    a=whole, at_a=whole, at_b=whole, b=whole, back=whole, beyond=whole, count=whole, entry=whole,
    far=whole, high=whole, item=whole, k=whole, la=whole, lb=whole, left=whole, low=whole, most=whole,
    n=whole, new_left=whole, new_right=whole, ra=whole, rb=whole, right=whole, room=whole, s=whole,
    segment=whole, size=whole, top=whole, triangle=whole, x=whole, x0=whole, x1=whole, y=whole,
    y0=whole, y1=whole
)
cdef whole look_from_cell(
    whole row, whole begin, const whole[::1] cells, const whole[::1] wide,
    const whole[::1] start_pointer, const whole[::1] start_triangle, const whole[::1] vx,
    const whole[::1] vy, const whole[::1] corner, const whole[::1] neighbour, const whole[::1] face,
    const whole[::1] bucket_pointer, const whole[::1] bucket_segment, const whole[::1] bucket_low,
    const whole[::1] bucket_high, const whole[::1] ax, const whole[::1] ay, const whole[::1] bx,
    const whole[::1] by, const whole[::1] units, whole reach, whole[::1] stack, whole[::1] out_segment,
    whole[::1] out_low, whole[::1] out_high
) noexcept nogil

@cython.locals(end=whole, row=whole)
cpdef whole look_from_all_cells(
    whole first_row, whole[::1] pointer, const whole[::1] cells, const whole[::1] wide,
    const whole[::1] start_pointer, const whole[::1] start_triangle, const whole[::1] vx,
    const whole[::1] vy, const whole[::1] corner, const whole[::1] neighbour, const whole[::1] face,
    const whole[::1] bucket_pointer, const whole[::1] bucket_segment, const whole[::1] bucket_low,
    const whole[::1] bucket_high, const whole[::1] ax, const whole[::1] ay, const whole[::1] bx,
    const whole[::1] by, const whole[::1] units, whole reach, whole[::1] stack, whole[::1] out_segment,
    whole[::1] out_low, whole[::1] out_high
) noexcept nogil
