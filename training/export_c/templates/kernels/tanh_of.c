/*
 * y (n) = hyperbolic tangents to 4e-7, relatively: quotients of polynomials of degree 13 and 6, with
 * the coefficients of the library Eigen (Eigen/src/Core/MathFunctionsImpl.h); beyond 9 the float
 * next to the result is 1.
 */
static void tanh_of_REAL(int n, const REAL *x, REAL *y)
{
    for (int i = 0; i < n; ++i) {
        const REAL u = x[i] > 9.0f ? 9.0f : x[i] < -9.0f ? -9.0f : x[i], q = u * u;
        REAL top = -2.76076847742355e-16f, bottom = 1.19825839466702e-06f;
        top = top * q + 2.00018790482477e-13f;
        top = top * q - 8.60467152213735e-11f;
        top = top * q + 5.12229709037114e-08f;
        top = top * q + 1.48572235717979e-05f;
        top = top * q + 6.37261928875436e-04f;
        top = top * q + 4.89352455891786e-03f;
        bottom = bottom * q + 1.18534705686654e-04f;
        bottom = bottom * q + 2.26843463243900e-03f;
        bottom = bottom * q + 4.89352518554385e-03f;
        const REAL t = u * top / bottom;
        y[i] = t > 1.0f ? 1.0f : t < -1.0f ? -1.0f : t;
    }
}
