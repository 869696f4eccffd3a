# Types of pair_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(at=double, entry=whole, face=whole, first=whole, k=whole, last=whole, of=whole)
cpdef void sum_up(
    double edge, const whole[::1] shown_first, const double[::1] begin_on, const double[::1] end_on,
    const whole[::1] faces, const double[::1] around, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y, const double[::1] arm,
    double[::1] sums_before, double[::1] sums, double[::1] sums_around
) noexcept nogil

@cython.locals(entry=whole, middle=whole)
cdef void add_before(
    whole to, double at, whole first, whole last, const double[::1] along,
    const double[::1] normal_x, const double[::1] normal_y, const double[::1] arm,
    const double[::1] sums_before, double[::1] sums
) noexcept nogil

@cython.locals(s1=double, s2=double, s3=double, turn=double)
cdef void add_moments(
    whole at, double a, double b, double x, double y, double arm, double[::1] moments
) noexcept nogil

@cython.locals(count=whole, entry=whole, found=whole, k=whole, other=whole, own=whole, row=whole)
cpdef whole firm_pairs(
    whole low, whole high, double least_stretch, double least, double hold, double lever,
    const whole[::1] pointer, const whole[::1] place, const whole[::1] surface,
    const whole[::1] shown_first, const whole[::1] row_on, const double[::1] begin_on,
    const double[::1] end_on, const double[::1] around,
    const double[::1] sums, const double[::1] sums_around, const double[::1] xy,
    double[::1] common, double[::1] moments, whole[::1] touched,
    whole[::1] out_row, whole[::1] out_other, double[::1] out_common
) noexcept nogil

@cython.locals(
    a=double, added=whole, ahead=double, b=double, end=whole, entry=whole, first=whole, high=double,
    laps=whole, least=whole, low=double, most=whole, other=whole, place=whole
)
cdef whole add_stretch(
    whole own, whole last, whole count, double least_stretch, double lap, whole turn,
    const whole[::1] row_on, const double[::1] begin_on, const double[::1] end_on,
    const double[::1] sums, const double[::1] sums_around,
    double[::1] common, double[::1] moments, whole[::1] touched
) noexcept nogil

@cython.locals(entry=whole)
cdef void add_common(
    whole at, whole first, whole end, whole added, whole turn, const double[::1] sums,
    const double[::1] sums_around, double[::1] moments
) noexcept nogil

@cython.locals(tt=double, xt=double, xx=double, xy=double, yt=double, yy=double)
cdef bint holds(
    double[::1] moments, whole at, double x, double y, double hold, double lever
) noexcept nogil
