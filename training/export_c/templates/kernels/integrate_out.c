/*
 * Integrate an error with a normal prior of standard deviation 1 out of a system of residuals. Its
 * columns are those of A, and the changes g of the residuals with the error, column `last`:
 *
 *     A' = A - g / (d + sqrt(d)) (g^T A),    d = 1 + g^T g
 *
 * Returns the determinant d. The system has m rows, which begin `step` apart; it is changed in its
 * place. `change` has room for the columns before the last.
 */
static REAL integrate_out_REAL(int m, int last, int step, REAL *system, REAL *change)
{
    const int wide = last - last % 4;
    REAL d = 1;
    for (int i = 0; i < m; ++i)
        d += system[i * step + last] * system[i * step + last];
    const REAL kappa = d + SQRT(d);
    sum_of_rows_REAL(m, last, step, system + last, system, change);
    for (int i = 0; i < m; ++i) {
        REAL *row = system + i * step;
        const REAL share = row[last] / kappa;
        for (int j = 0; j < wide; j += 4)
            store_REAL(plus_REAL(load_REAL(row + j), -share, load_REAL(change + j)), row + j);
        for (int j = wide; j < last; ++j)
            row[j] -= share * change[j];
    }
    return d;
}
