/* The sum of n elements, in eight parts, which compilers compute side by side. */
static REAL sum_of_REAL(const REAL *x, int n)
{
    REAL part[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    REAL total = 0;
    int i = 0;
    for (; i + 8 <= n; i += 8)
        for (int j = 0; j < 8; ++j)
            part[j] += x[i + j];
    for (; i < n; ++i)
        total += x[i];
    for (int j = 0; j < 8; ++j)
        total += part[j];
    return total;
}
