/* Whether n numbers are finite. */
static bool all_finite_REAL(const REAL *x, int n)
{
    for (int i = 0; i < n; ++i)
        if (!isfinite(x[i]))
            return false;
    return true;
}
