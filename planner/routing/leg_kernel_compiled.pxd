# Types of leg_kernel.py where it is compiled (setup.py).

cimport cython
from libc cimport math

ctypedef long long whole
cdef double TURN

@cython.locals(
    across=double, along=double, angle=double, begin=whole, end=whole, heading=double, here=whole, last=double,
    length=double, run=double, spent=double, there=whole, turn=double
)
cpdef void follow(
    whole source, whole ends, const double[::1] x, const double[::1] y, const int[::1] before, double speed,
    double acceleration, double turn_rate, double slack, double[::1] seconds, double[::1] leaving,
    double[::1] arriving
) noexcept nogil

@cython.locals(apart=double)
cdef double bend(double one, double other) noexcept nogil

cdef double straight(double length, double speed, double acceleration) noexcept nogil
