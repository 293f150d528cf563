// SPDX-License-Identifier: MIT OR Apache-2.0
// A quadratic program with bounds by ADMM: what `qp_box` of the library computes, of 20 variables, in 20 iterations.

enum { N = 20, ITERATIONS = 20 };

// M is (P + ρ·1)⁻¹; z and y remain from period to period.
float M[N][N], q[N], low[N], high[N], z[N], y[N];

static float between(float x, float least, float most)
{
    return x < least ? least : x > most ? most : x;
}

// P is diagonal with a border, so that M is close to the inverse of its diagonal.
void prepare(void)
{
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++)
            M[i][j] = i == j ? 0.4f : 0.01f * (float)((i * 7 + j * 7) % 5 - 2);
        q[i] = 0.3f * (float)(i % 7 - 3);
        low[i] = -0.25f;
        high[i] = 0.5f;
    }
}

void kernel(void)
{
    const float rho = 2.0f;
    float w[N];
    for (int i = 0; i < N; i++)
        w[i] = rho * (z[i] - y[i]) - q[i];
    for (int turn = 0; turn < ITERATIONS; turn++) {
        float v[N];
        for (int j = 0; j < N; j++)
            v[j] = w[j];
        for (int i = 0; i < N; i++) {
            float x[4] = { 0, 0, 0, 0 };
            for (int j = 0; j < N; j += 4)
                for (int g = 0; g < 4; g++)
                    x[g] += M[i][j + g] * v[j + g];
            float sum = x[0] + x[1] + (x[2] + x[3]) + y[i];
            z[i] = between(sum, low[i], high[i]);
            y[i] = sum - z[i];
            w[i] = rho * (z[i] - y[i]) - q[i];
        }
    }
}

float checked(int n)
{
    kernel();
    return z[(unsigned)n % N] + y[(unsigned)n % N];
}
