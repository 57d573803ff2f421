/* The test harness: a test file is a list of sentences, run in order in one process.
 *
 *     static void restores_volume_after_squeeze(void) { CHECK_NEAR(volume, 1.0, 1e-3); }
 *     int main(void) { RUN(restores_volume_after_squeeze); return check_report(); }
 *
 * A failed check prints file, line and the numbers, marks the test failed and goes on. check_report prints
 * "N passed, N failed, N skipped" (tests, not checks) and gives the exit code: 0, 1 when one failed, 77 when one was
 * skipped. A test that ran no check counts as failed. What each took of the processor is printed and never checked.
 * check_shared(path) gives the path of a file of ../shared (environment PAL_SHARED, default ../shared) or NULL when it
 * is not there; the test then counts as skipped, whatever else it checked. */
#ifndef TESTS_CHECK_H
#define TESTS_CHECK_H
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static int check_passed, check_failed, check_skipped, check_count;
static bool check_bad;
static char check_missing[1024]; /* path of the data that the current test lacks; empty: none */

/* the largest distance of two lists of n points */
static inline double check_farthest(const float *a, const float *b, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) {
        double far = 0;
        for (int c = 0; c < 3; c++) far += pow((double)a[3 * i + c] - (double)b[3 * i + c], 2);
        max = fmax(max, sqrt(far));
    }
    return max;
}

#define CHECK_FAIL(...)                                                                                                \
    do {                                                                                                               \
        printf("  %s:%d: ", __FILE__, __LINE__);                                                                       \
        printf(__VA_ARGS__);                                                                                           \
        printf("\n");                                                                                                  \
        check_bad = true;                                                                                              \
    } while (0)
#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        check_count++;                                                                                                 \
        if (!(condition)) CHECK_FAIL("%s", #condition);                                                                \
    } while (0)
/* |a - b| <= tolerance, absolute; NaN fails */
#define CHECK_NEAR(a, b, tolerance)                                                                                    \
    do {                                                                                                               \
        double check_a = (a), check_b = (b), check_t = (tolerance);                                                    \
        check_count++;                                                                                                 \
        if (!(fabs(check_a - check_b) <= check_t))                                                                     \
            CHECK_FAIL("%s = %.9g, wanted %.9g +- %.3g", #a, check_a, check_b, check_t);                               \
    } while (0)
/* a <= b; NaN fails */
#define CHECK_LE(a, b)                                                                                                 \
    do {                                                                                                               \
        double check_a = (a), check_b = (b);                                                                           \
        check_count++;                                                                                                 \
        if (!(check_a <= check_b)) CHECK_FAIL("%s = %.9g, wanted <= %.9g", #a, check_a, check_b);                      \
    } while (0)
#define CHECK_INT(a, b)                                                                                                \
    do {                                                                                                               \
        long long check_a = (long long)(a), check_b = (long long)(b);                                                  \
        check_count++;                                                                                                 \
        if (check_a != check_b) CHECK_FAIL("%s = %lld, wanted %lld", #a, check_a, check_b);                            \
    } while (0)
#define CHECK_TEXT(a, b)                                                                                               \
    do {                                                                                                               \
        const char *check_a = (a), *check_b = (b);                                                                     \
        check_count++;                                                                                                 \
        if (!check_a || strcmp(check_a, check_b))                                                                      \
            CHECK_FAIL("%s = \"%s\", wanted \"%s\"", #a, check_a ? check_a : "(null)", check_b);                       \
    } while (0)
/* stops the test function when the rest would make no sense */
#define REQUIRE(condition)                                                                                             \
    do {                                                                                                               \
        check_count++;                                                                                                 \
        if (!(condition)) {                                                                                            \
            CHECK_FAIL("%s (test given up here)", #condition);                                                         \
            return;                                                                                                    \
        }                                                                                                              \
    } while (0)
#define RUN(test)                                                                                                      \
    do {                                                                                                               \
        check_bad = false;                                                                                             \
        check_count = 0;                                                                                               \
        check_missing[0] = 0;                                                                                          \
        const clock_t check_from = clock();                                                                            \
        test();                                                                                                        \
        if (check_count == 0 && !check_missing[0]) check_bad = true;                                                   \
        if (check_missing[0] && !check_bad) {                                                                          \
            printf("SKIP %s: %s is not there\n", #test, check_missing);                                                \
            check_skipped++;                                                                                           \
        } else {                                                                                                       \
            printf("%s %s (%d checks, %.2f s of processor)\n", check_bad ? "FAIL" : "ok  ", #test, check_count,        \
                   (double)(clock() - check_from) / CLOCKS_PER_SEC);                                                   \
            if (check_bad)                                                                                             \
                check_failed++;                                                                                        \
            else                                                                                                       \
                check_passed++;                                                                                        \
        }                                                                                                              \
        fflush(stdout);                                                                                                \
    } while (0)
/* Sanitizers make a step ten times as long. What only looks longer at the same code is left to release: RUN_LONG leaves
 * a test out of those builds, and says so; CHECK_REPEATS(n, less) is how often to do the same. */
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define CHECK_REPEATS(n, less) (less)
#define RUN_LONG(test)                                                                                                 \
    do {                                                                                                               \
        (void)test;                                                                                                    \
        printf("not in this build: %s\n", #test);                                                                      \
    } while (0)
#else
#define CHECK_REPEATS(n, less) (n)
#define RUN_LONG(test)         RUN(test)
#endif

/* a test whose threads are those of another one in its file: left out under the thread sanitizer, which would see
 * nothing new */
#ifdef __SANITIZE_THREAD__
#define RUN_SERIAL(test) RUN_LONG(test)
#else
#define RUN_SERIAL(test) RUN(test)
#endif

static inline int check_report(void)
{
    printf("%d passed, %d failed, %d skipped\n", check_passed, check_failed, check_skipped);
    return check_failed > 0 ? 1 : check_skipped > 0 ? 77 : 0;
}

static inline const char *check_shared(const char *path)
{
    static char full[4][1024];
    static int turn;
    char *buffer = full[turn++ & 3];
    const char *root = getenv("PAL_SHARED");
    snprintf(buffer, 1024, "%s/%s", root ? root : "../shared", path);
    if (access(buffer, R_OK) == 0) return buffer;
    snprintf(check_missing, sizeof check_missing, "%s", buffer);
    return NULL;
}
#endif
