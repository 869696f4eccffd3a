# Types of pair_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(count=whole, entry=whole, found=whole, k=whole, other=whole, own=whole, row=whole)
cpdef whole firm_pairs(
    whole low, whole high, double edge, double least_stretch, double least, double hold,
    double lever,
    const whole[::1] pointer, const whole[::1] surface, const double[::1] begin, const double[::1] end,
    const whole[::1] shown_first, const whole[::1] row_on, const double[::1] begin_on,
    const double[::1] end_on,
    const whole[::1] faces, const double[::1] around, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y,
    const double[::1] arm, const double[::1] xy, double[::1] common, double[::1] moments, whole[::1] touched,
    whole[::1] out_row, whole[::1] out_other, double[::1] out_common
) noexcept nogil

@cython.locals(
    a=double, ahead=double, b=double, first=whole, high=double, lap=double, last=whole, low=double,
    middle=whole, of=whole, other=whole, place=whole
)
cdef whole add_stretch(
    whole own, whole row, whole count, double edge, double least_stretch,
    const whole[::1] surface, const double[::1] begin, const double[::1] end,
    const whole[::1] shown_first, const whole[::1] row_on, const double[::1] begin_on,
    const double[::1] end_on,
    const whole[::1] faces, const double[::1] around, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y,
    const double[::1] arm, double[::1] common, double[::1] moments, whole[::1] touched
) noexcept nogil

cdef void add_common(
    whole at, double a, double b, double lap, whole first, whole last, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y,
    const double[::1] arm, double[::1] moments
) noexcept nogil

@cython.locals(high=whole, length=double, middle=whole)
cdef void add_faces(
    whole at, double a, double b, whole first, whole last, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y,
    const double[::1] arm, double[::1] moments
) noexcept nogil

@cython.locals(s1=double, s2=double, s3=double, turn=double)
cdef void add_moments(
    whole at, double a, double b, double x, double y, double arm, double[::1] moments
) noexcept nogil

@cython.locals(tt=double, xt=double, xx=double, xy=double, yt=double, yy=double)
cdef bint holds(
    double[::1] moments, whole at, double x, double y, double hold, double lever
) noexcept nogil
