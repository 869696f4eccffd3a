# Types of component_kernel.py where it is compiled (setup.py).

cimport cython

ctypedef long long whole

@cython.locals(components=whole, here=whole, link=whole, row=whole, size=whole, there=whole)
cpdef void label_components(
    const whole[::1] first, const whole[::1] to, const whole[::1] inside, whole[::1] label, whole[::1] stack
) noexcept nogil
