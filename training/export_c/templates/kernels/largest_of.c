/* The largest of n elements, one or more, which are `step` apart. */
static REAL largest_of_REAL(const REAL *x, int n, int step)
{
    REAL best = x[0];
    for (int i = 1; i < n; ++i)
        best = x[i * step] > best ? x[i * step] : best;
    return best;
}
