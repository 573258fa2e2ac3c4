/*
 * Exponentials of n elements over their sum; the largest is subtracted, so that none overflows, and
 * those that would be smaller than any normal number are zero.
 */
static void softmax_REAL(const REAL *x, int n, REAL *y)
{
    REAL largest = x[0], total = 0;
    for (int i = 1; i < n; ++i)
        largest = x[i] > largest ? x[i] : largest;
    for (int i = 0; i < n; ++i) {
        y[i] = x[i] - largest < LEAST_POWER ? 0 : EXP(x[i] - largest);
        total += y[i];
    }
    for (int i = 0; i < n; ++i)
        y[i] /= total;
}
