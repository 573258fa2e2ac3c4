/* The sum of n elements, which are `step` apart. */
static REAL sum_of_REAL(const REAL *x, int n, int step)
{
    REAL total = 0;
    for (int i = 0; i < n; ++i)
        total += x[i * step];
    return total;
}
