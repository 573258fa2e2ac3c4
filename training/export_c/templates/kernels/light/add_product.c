/*
 * y (m x n) += alpha a b, with a (m x k) and b (k x n). Element (i, p) of a is a[i * row + p * step];
 * b and y lie by rows. Sixteen sums are formed in registers, four rows of four.
 */
static void add_product_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row, int step,
                             const REAL *b, REAL *y)
{
    int i = 0;
    for (; i + 4 <= m; i += 4) {
        int j = 0;
        for (; j + 4 <= n; j += 4) {
            const REAL *a0 = a + i * row, *a1 = a0 + row, *a2 = a1 + row, *a3 = a2 + row;
            const REAL *right = b + j;
            REAL r0 = 0, r1 = 0, r2 = 0, r3 = 0, s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            REAL t0 = 0, t1 = 0, t2 = 0, t3 = 0, u0 = 0, u1 = 0, u2 = 0, u3 = 0;
            for (int p = 0; p < k; ++p) {
                const REAL b0 = right[0], b1 = right[1], b2 = right[2], b3 = right[3];
                REAL x = a0[p * step];
                r0 += x * b0;
                r1 += x * b1;
                r2 += x * b2;
                r3 += x * b3;
                x = a1[p * step];
                s0 += x * b0;
                s1 += x * b1;
                s2 += x * b2;
                s3 += x * b3;
                x = a2[p * step];
                t0 += x * b0;
                t1 += x * b1;
                t2 += x * b2;
                t3 += x * b3;
                x = a3[p * step];
                u0 += x * b0;
                u1 += x * b1;
                u2 += x * b2;
                u3 += x * b3;
                right += n;
            }
            REAL *to = y + i * n + j;
            to[0] += alpha * r0;
            to[1] += alpha * r1;
            to[2] += alpha * r2;
            to[3] += alpha * r3;
            to += n;
            to[0] += alpha * s0;
            to[1] += alpha * s1;
            to[2] += alpha * s2;
            to[3] += alpha * s3;
            to += n;
            to[0] += alpha * t0;
            to[1] += alpha * t1;
            to[2] += alpha * t2;
            to[3] += alpha * t3;
            to += n;
            to[0] += alpha * u0;
            to[1] += alpha * u1;
            to[2] += alpha * u2;
            to[3] += alpha * u3;
        }
        for (; j < n; ++j)
            for (int r = i; r < i + 4; ++r) {
                const REAL *left = a + r * row, *right = b + j;
                REAL s = 0;
                for (int p = 0; p < k; ++p) {
                    s += left[p * step] * *right;
                    right += n;
                }
                y[r * n + j] += alpha * s;
            }
    }
    for (; i + 2 <= m; i += 2) {
        int j = 0;
        for (; j + 4 <= n; j += 4) {
            const REAL *up = a + i * row, *down = up + row, *right = b + j;
            REAL s0 = 0, s1 = 0, s2 = 0, s3 = 0, t0 = 0, t1 = 0, t2 = 0, t3 = 0;
            for (int p = 0; p < k; ++p) {
                const REAL u = *up, v = *down;
                s0 += u * right[0];
                t0 += v * right[0];
                s1 += u * right[1];
                t1 += v * right[1];
                s2 += u * right[2];
                t2 += v * right[2];
                s3 += u * right[3];
                t3 += v * right[3];
                up += step;
                down += step;
                right += n;
            }
            REAL *const first = y + i * n + j, *const second = first + n;
            first[0] += alpha * s0;
            first[1] += alpha * s1;
            first[2] += alpha * s2;
            first[3] += alpha * s3;
            second[0] += alpha * t0;
            second[1] += alpha * t1;
            second[2] += alpha * t2;
            second[3] += alpha * t3;
        }
        for (; j < n; ++j) {
            const REAL *up = a + i * row, *down = up + row, *right = b + j;
            REAL s = 0, t = 0;
            for (int p = 0; p < k; ++p) {
                s += *up * *right;
                t += *down * *right;
                up += step;
                down += step;
                right += n;
            }
            y[i * n + j] += alpha * s;
            y[(i + 1) * n + j] += alpha * t;
        }
    }
    for (; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *up = a + i * row, *right = b + j;
            REAL s = 0;
            for (int p = 0; p < k; ++p) {
                s += *up * *right;
                up += step;
                right += n;
            }
            y[i * n + j] += alpha * s;
        }
}
