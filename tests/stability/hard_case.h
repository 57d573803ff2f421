/* Hard cases on record. Beside the checks of a test stands what the table of hard cases tells of them, so that the
 * assertion and the table have one number:
 *
 *     HARD_CASE("plane", "fem", "off rest after 10 s", 100 * rms / size, 0.1, "% S");
 *
 * Cases are those of catalogue.txt; models are one or several of tet_springs,
 * adaptive_springs, fem, subdivision_fem, separated by a blank. Of figures with the same case, model and words the
 * worst is kept, counts are added up. When the environment names a folder in PAL_HARD_CASES (ctest does), what was
 * recorded is written there at the end, one file for each test; make_table.sh makes tables of them. Builds with
 * sanitizers run shorter versions and record nothing. */
#ifndef TESTS_STABILITY_HARD_CASE_H
#define TESTS_STABILITY_HARD_CASE_H
#include "tests/check.h"

/* asserts value <= bound */
#define HARD_CASE(id, models, what, value, bound, unit)                                                                \
    do {                                                                                                               \
        double hard_v = (value), hard_b = (bound);                                                                     \
        hard_record("le", id, models, what, hard_v, hard_b, unit);                                                     \
        check_count++;                                                                                                 \
        if (!(hard_v <= hard_b))                                                                                       \
            CHECK_FAIL("%s (%s), %s: %.9g, wanted <= %.9g %s", id, models, what, hard_v, hard_b, unit);                \
    } while (0)
/* asserts good == n: n times the case, good times what should be was */
#define HARD_CASE_ALL(id, models, what, good, n)                                                                       \
    do {                                                                                                               \
        double hard_v = (good), hard_b = (n);                                                                          \
        hard_record("all", id, models, what, hard_v, hard_b, "");                                                      \
        check_count++;                                                                                                 \
        if (hard_v != hard_b) CHECK_FAIL("%s (%s), %s: %g of %g", id, models, what, hard_v, hard_b);                   \
    } while (0)
/* a criterion that is known not to be kept, marked by the table: asserts value <= allowed, and that the bound is still
 * missed: else the mark is out of date. Give the worst of all runs, once. Sanitizers' shorter runs may keep the bound
 */
#define HARD_CASE_MISSED(id, models, what, value, bound, allowed, unit)                                                \
    do {                                                                                                               \
        double hard_v = (value), hard_b = (bound), hard_c = (allowed);                                                 \
        hard_record("missed", id, models, what, hard_v, hard_b, unit)->ceiling = hard_c;                               \
        check_count++;                                                                                                 \
        if (!(hard_v <= hard_c) || !isfinite(hard_c))                                                                  \
            CHECK_FAIL("%s (%s), %s: %.9g, wanted <= %.9g %s", id, models, what, hard_v, hard_c, unit);                \
        if (HARD_WHOLE && hard_v <= hard_b)                                                                            \
            CHECK_FAIL("%s (%s), %s: %.9g keeps %.9g %s: the mark is out of date", id, models, what, hard_v, hard_b,   \
                       unit);                                                                                          \
    } while (0)
/* the case cannot be put to these models; why is a sentence */
#define HARD_CASE_NONE(id, models, reason)                                                                             \
    do {                                                                                                               \
        check_count++;                                                                                                 \
        hard_record("none", id, models, reason, 0, 0, "");                                                             \
    } while (0)

enum {
    HARD_RECORDS = 256,
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
    HARD_WHOLE = 0
#else
    HARD_WHOLE = 1
#endif
};
typedef struct hard_row {
    char id[32], model[32], kind[8], what[160], unit[48];
    double value, bound, ceiling; /* the last of what is missed */
    int n;                        /* figures of which this is the worst */
} hard_row;

static hard_row hard_rows[HARD_RECORDS];
static int hard_n_row;

/* one file for each test, named after it */
static void hard_write(void)
{
    const char *folder = getenv("PAL_HARD_CASES"), *base = strrchr(__BASE_FILE__, '/');
    char path[1024];
    if (!folder || !HARD_WHOLE) return;
    base = base ? base + 1 : __BASE_FILE__;
    snprintf(path, sizeof path, "%s/%.*s.tsv", folder, (int)strcspn(base, "."), base);
    FILE *f = fopen(path, "w");
    if (!f) {
        printf("  hard cases are not recorded: %s cannot be written\n", path);
        return;
    }
    for (int i = 0; i < hard_n_row; i++) {
        const hard_row *r = &hard_rows[i];
        fprintf(f, "%s\t%s\t%s\t%s\t%.3g\t%.6g\t%s\t%.*s\t%d\t%.6g\n", r->id, r->model, r->kind, r->what, r->value,
                r->bound, r->unit, (int)strcspn(base, "."), base, r->n, r->ceiling);
    }
    fclose(f);
}

/* the row of case, model and words, a new one if there is none */
static hard_row *hard_row_of(const char *id, const char *model, int n_model, const char *what)
{
    for (int i = 0; i < hard_n_row; i++) {
        hard_row *r = &hard_rows[i];
        if (!strcmp(r->id, id) && (int)strlen(r->model) == n_model && !strncmp(r->model, model, (size_t)n_model) &&
            !strcmp(r->what, what))
            return r;
    }
    if (hard_n_row == HARD_RECORDS) abort();
    if (hard_n_row == 0) atexit(hard_write);
    hard_row *r = &hard_rows[hard_n_row++];
    snprintf(r->id, sizeof r->id, "%s", id);
    snprintf(r->model, sizeof r->model, "%.*s", n_model, model);
    snprintf(r->what, sizeof r->what, "%s", what);
    return r;
}

/* how far a figure is along its bound; with a bound of nothing the figure itself; one that is none is the worst of all
 */
static double hard_ratio(double value, double bound)
{
    const double ratio = bound > 0 ? value / bound : value;
    return isnan(ratio) ? INFINITY : ratio;
}

/* returns the row of the last model */
static inline hard_row *hard_record(const char *kind, const char *id, const char *models, const char *what,
                                    double value, double bound, const char *unit)
{
    hard_row *r = NULL;
    for (const char *model = models; *model;) {
        const int n_model = (int)strcspn(model, " ");
        r = hard_row_of(id, model, n_model, what);
        const bool count = !strcmp(kind, "all"), first = r->n++ == 0;
        if (count && !first)
            r->value += value, r->bound += bound;
        else if (first || hard_ratio(value, bound) > hard_ratio(r->value, r->bound))
            r->value = value, r->bound = bound;
        snprintf(r->kind, sizeof r->kind, "%s", kind);
        snprintf(r->unit, sizeof r->unit, "%s", unit);
        model += n_model;
        model += strspn(model, " ");
    }
    return r;
}
#endif
