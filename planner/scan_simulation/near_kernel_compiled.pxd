# Types of near_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole
ctypedef int index

cdef whole SHIFT, ALONG_X, ALONG_Y
cdef double SLACK_M

@cython.locals(
    at=whole, away=double, axis=whole, bucket=whole, limit=double, point=index, query=whole, total=double,
    wide=double, x=whole, x0=whole, x1=whole, y=whole, y0=whole, y1=whole, z0=whole, z1=whole
)
cpdef void mark_near(
    const double[::1] points, const index[::1] first, whole mask, double per_metre,
    const double[::1] queries, double within, signed char[::1] query_near, signed char[::1] point_near
) noexcept nogil

cdef whole cube(double place, double per_metre) noexcept nogil
