/* The largest of n elements, one or more. */
static REAL largest_of_REAL(const REAL *x, int n)
{
    REAL best = x[0];
    for (int i = 1; i < n; ++i)
        best = x[i] > best ? x[i] : best;
    return best;
}
