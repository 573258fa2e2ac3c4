/*
 * y (n) = hyperbolic tangents to 4e-7, relatively: quotients of polynomials of degree 13 and 6, with
 * the coefficients of the library Eigen (Eigen/src/Core/MathFunctionsImpl.h); beyond 9 the float
 * next to the result is 1. Sixteen are taken side by side, in loops that compilers turn into vector
 * instructions.
 */
static void tanh_of_REAL(int n, const REAL *x, REAL *y)
{
    REAL u[16] = {0};
    for (int i = 0; i < n; i += 16) {
        const int few = n - i < 16 ? n - i : 16;
        for (int q = 0; q < few; ++q)
            u[q] = x[i + q];
        for (int q = 0; q < 16; ++q)
            u[q] = at_least_REAL(u[q], -9.0f);
        for (int q = 0; q < 16; ++q)
            u[q] = at_most_REAL(u[q], 9.0f);
        for (int q = 0; q < 16; ++q) {
            const REAL square = u[q] * u[q];
            REAL top = -2.76076847742355e-16f, bottom = 1.19825839466702e-06f;
            top = top * square + 2.00018790482477e-13f;
            top = top * square - 8.60467152213735e-11f;
            top = top * square + 5.12229709037114e-08f;
            top = top * square + 1.48572235717979e-05f;
            top = top * square + 6.37261928875436e-04f;
            top = top * square + 4.89352455891786e-03f;
            bottom = bottom * square + 1.18534705686654e-04f;
            bottom = bottom * square + 2.26843463243900e-03f;
            bottom = bottom * square + 4.89352518554385e-03f;
            u[q] = u[q] * top / bottom;
        }
        for (int q = 0; q < 16; ++q)
            u[q] = at_least_REAL(u[q], -1.0f);
        for (int q = 0; q < 16; ++q)
            u[q] = at_most_REAL(u[q], 1.0f);
        for (int q = 0; q < few; ++q)
            y[i + q] = u[q];
    }
}
