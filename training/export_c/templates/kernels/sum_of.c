/* The sum of n elements, in eight parts, which compilers compute side by side. */
static REAL sum_of_REAL(const REAL *x, int n)
{
    REAL part[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    REAL total = 0;
    const int rest = n % 8;
    for (int i = 0; i < rest; ++i)
        total += x[i];
    for (int i = rest; i < n; i += 8)
        for (int j = 0; j < 8; ++j)
            part[j] += x[i + j];
    for (int j = 0; j < 8; ++j)
        total += part[j];
    return total;
}
