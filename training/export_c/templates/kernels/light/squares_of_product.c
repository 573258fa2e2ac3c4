/* y (n) = sums of squares of the columns of a b, with a (m x k) and b (k x n), both by rows. Sixteen
 * sums are formed in registers, four rows of four. */
static void squares_of_product_REAL(int m, int k, int n, const REAL *a, const REAL *b, REAL *y)
{
    int j = 0;
    for (; j + 4 <= n; j += 4) {
        REAL y0 = 0, y1 = 0, y2 = 0, y3 = 0;
        int i = 0;
        for (; i + 4 <= m; i += 4) {
            const REAL *a0 = a + i * k, *a1 = a0 + k, *a2 = a1 + k, *a3 = a2 + k, *right = b + j;
            REAL r0 = 0, r1 = 0, r2 = 0, r3 = 0, s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            REAL t0 = 0, t1 = 0, t2 = 0, t3 = 0, u0 = 0, u1 = 0, u2 = 0, u3 = 0;
            for (int p = 0; p < k; ++p) {
                const REAL b0 = right[0], b1 = right[1], b2 = right[2], b3 = right[3];
                REAL x = a0[p];
                r0 += x * b0;
                r1 += x * b1;
                r2 += x * b2;
                r3 += x * b3;
                x = a1[p];
                s0 += x * b0;
                s1 += x * b1;
                s2 += x * b2;
                s3 += x * b3;
                x = a2[p];
                t0 += x * b0;
                t1 += x * b1;
                t2 += x * b2;
                t3 += x * b3;
                x = a3[p];
                u0 += x * b0;
                u1 += x * b1;
                u2 += x * b2;
                u3 += x * b3;
                right += n;
            }
            y0 += r0 * r0 + s0 * s0 + t0 * t0 + u0 * u0;
            y1 += r1 * r1 + s1 * s1 + t1 * t1 + u1 * u1;
            y2 += r2 * r2 + s2 * s2 + t2 * t2 + u2 * u2;
            y3 += r3 * r3 + s3 * s3 + t3 * t3 + u3 * u3;
        }
        const REAL *up = a + i * k;
        for (; i < m; ++i) {
            const REAL *right = b + j;
            REAL s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            for (int p = 0; p < k; ++p) {
                s0 += up[p] * right[0];
                s1 += up[p] * right[1];
                s2 += up[p] * right[2];
                s3 += up[p] * right[3];
                right += n;
            }
            y0 += s0 * s0;
            y1 += s1 * s1;
            y2 += s2 * s2;
            y3 += s3 * s3;
            up += k;
        }
        y[j] = y0;
        y[j + 1] = y1;
        y[j + 2] = y2;
        y[j + 3] = y3;
    }
    for (; j < n; ++j) {
        y[j] = 0;
        for (int i = 0; i < m; ++i) {
            REAL s = 0;
            for (int p = 0; p < k; ++p)
                s += a[i * k + p] * b[p * n + j];
            y[j] += s * s;
        }
    }
}
