/*
 * Integrate an error with a normal prior of standard deviation 1 out of a system of residuals. Its
 * columns are those of A, and the changes g of the residuals with the error, column `last`:
 *
 *     A' = A - g / (d + sqrt(d)) (g^T A),    d = 1 + g^T g
 *
 * Returns the determinant d. The system has m rows, which begin `step` apart, a multiple of four;
 * it is changed in its place. Columns from `last` on are of no use afterwards.
 */
static REAL integrate_out_REAL(int m, int last, int step, REAL *system, REAL *change)
{
    REAL d = 1;
    for (int i = 0; i < m; ++i)
        d += system[i * step + last] * system[i * step + last];
    const REAL kappa = d + SQRT(d);
    for (int j = 0; j < last; j += 4) {
        four_REAL sum = {0};
        for (int i = 0; i < m; ++i)
            sum = plus_REAL(sum, system[i * step + last], load_REAL(system + i * step + j));
        store_REAL(sum, change + j);
    }
    for (int i = 0; i < m; ++i) {
        REAL *row = system + i * step;
        const REAL share = row[last] / kappa;
        for (int j = 0; j < last; j += 4)
            store_REAL(plus_REAL(load_REAL(row + j), -share, load_REAL(change + j)), row + j);
    }
    return d;
}
