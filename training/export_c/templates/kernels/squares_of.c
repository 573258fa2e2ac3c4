/* The sum of n squares of elements, which are `step` apart. */
static REAL squares_of_REAL(const REAL *x, int n, int step)
{
    REAL total = 0;
    for (int i = 0; i < n; ++i)
        total += x[i * step] * x[i * step];
    return total;
}
