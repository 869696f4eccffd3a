# Types of bresenham_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(k=whole)
cpdef void clear_lines(
    const unsigned char[::1] occupied, whole width, whole x, whole y, const whole[::1] end_x, const whole[::1] end_y,
    const unsigned char[::1] own, unsigned char[::1] clear
) noexcept nogil

@cython.locals(dx=whole, dy=whole, error=whole, step_x=whole, step_y=whole, twice=whole)
cdef bint clear_line(
    const unsigned char[::1] occupied, whole width, whole x, whole y, whole end_x, whole end_y, bint own
) noexcept nogil
