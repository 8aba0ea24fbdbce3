/* Triad a = b + 3 c over 128 MiB an array: best of ten, GB/s, 24 bytes counted for each element. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(void) {
    size_t n = 1 << 24;
    double *a = malloc(8 * n), *b = malloc(8 * n), *c = malloc(8 * n), best = 1e9;
    for (size_t i = 0; i < n; i++) a[i] = 0, b[i] = i, c[i] = 1;
    for (int k = 0; k < 10; k++) {
        double start = now();
        for (size_t i = 0; i < n; i++) a[i] = b[i] + (k + 3) * c[i];
        double seconds = now() - start;
        if (seconds < best) best = seconds;
    }
    printf("%.1f\n", a[n / 2] > 0 ? 24e-9 * n / best : 0);
    return 0;
}
