/* A study that is ended at random moments and taken up again, with what it was told to keep: the same answers as in one
 * go, and none of them worked out twice. */
#include "server/study/study.h"
#include "tests/check.h"
#include "tests/fixtures/beam_problem.h"
#include "tests/fixtures/random.h"

enum { MAX_ANSWERS = 64, MAX_NUMBERS = 3000, MAX_ENDS = 400 };

typedef struct kept {
    uint64_t key;
    pal_study_answer answer;
    int n;
    double value[MAX_NUMBERS];
} kept;

typedef struct run {
    kept *kept; /* [MAX_ANSWERS] */
    int n_kept, n_recalled, n_twice;
    pal_study *so_far; /* as `done` was told last */
    int left;          /* looks until it is ended, which lasts; below 0: never */
    int n_looks;
} run;

static bool recall(uint64_t key, pal_study_answer *answer, double *value, int n, void *user)
{
    run *r = user;
    for (int k = 0; k < r->n_kept; k++) {
        if (r->kept[k].key != key || r->kept[k].n != n) continue;
        *answer = r->kept[k].answer;
        memcpy(value, r->kept[k].value, sizeof *value * (size_t)n);
        r->n_recalled++;
        return true;
    }
    return false;
}

static void remember(uint64_t key, const pal_study_answer *answer, const double *value, int n, void *user)
{
    run *r = user;
    CHECK(n > 0 && n <= MAX_NUMBERS && r->n_kept < MAX_ANSWERS);
    if (!(n > 0 && n <= MAX_NUMBERS && r->n_kept < MAX_ANSWERS)) return;
    for (int k = 0; k < r->n_kept; k++) r->n_twice += r->kept[k].key == key;
    kept *to = &r->kept[r->n_kept++];
    to->key = key, to->answer = *answer, to->n = n;
    memcpy(to->value, value, sizeof *value * (size_t)n);
}

static bool done(const pal_study *study, int n_total, void *user)
{
    run *r = user;
    (void)n_total;
    *r->so_far = *study;
    return true;
}

static bool may_continue(void *user)
{
    run *r = user;
    r->n_looks++;
    if (r->left > 0) r->left--;
    return r->left != 0;
}

/* from what was kept and measured before; the points of `before` stand in so_far as long as none is new */
static pal_err go(run *r, const pal_problem *p, const pal_surface *beam, int left, pal_study *out)
{
    static const char *const method[] = {"fem"};
    static pal_study before;
    pal_diagnostic diag = {{0}};
    before = *r->so_far;
    pal_study_options o = {.quick = 1,
                           .seconds = 0.05,
                           .method = method,
                           .n_method = 1,
                           .before = &before,
                           .recall = recall,
                           .remember = remember,
                           .done = done,
                           .may_continue = may_continue,
                           .user = r};
    r->left = left, r->n_looks = 0;
    pal_err err = pal_study_problem(p, &p->load_case[0], beam, &o, out, &diag);
    if (err && err != PAL_ERR_STATE) CHECK_FAIL("%s", diag.text);
    return err;
}

/* all but times, what is on the front by them, and what is foreseen of them */
static void check_same(const pal_study *a, const pal_study *b)
{
    CHECK_INT(a->n_point, b->n_point);
    CHECK_TEXT(a->reference, b->reference);
    CHECK(a->reference_m == b->reference_m && a->max_m == b->max_m && a->length_scale_m == b->length_scale_m);
    for (int i = 0; i < a->n_point; i++) {
        const pal_study_point *p = &a->point[i], *q = &b->point[i];
        CHECK(pal_configuration_equal(&p->measured.configuration, &q->measured.configuration) && p->err == q->err);
        CHECK(p->measured.error_m == q->measured.error_m && p->static_rms_m == q->static_rms_m);
        CHECK(p->trajectory_max_m == q->trajectory_max_m && p->trajectory_rms_m == q->trajectory_rms_m);
        CHECK(p->n_node == q->n_node && p->n_substep == q->n_substep);
        CHECK(p->measured.configuration.k_distance_J == q->measured.configuration.k_distance_J);
    }
}

static void ended_anywhere_it_goes_on_to_the_same_table(void)
{
    pal_surface beam;
    pal_problem *p = malloc(sizeof *p);
    pal_study *once = calloc(1, sizeof *once), *again = calloc(1, sizeof *again);
    run all = {.kept = calloc(MAX_ANSWERS, sizeof(kept)), .so_far = calloc(1, sizeof(pal_study))};
    run parts = {.kept = calloc(MAX_ANSWERS, sizeof(kept)), .so_far = calloc(1, sizeof(pal_study))};
    REQUIRE(p && once && again && all.kept && all.so_far && parts.kept && parts.so_far && make_beam(&beam, p));
    CHECK(go(&all, p, &beam, -1, once) == PAL_ERR_OK);
    /* the rest at three sizes and the way, none asked for twice */
    CHECK_INT(all.n_kept, 4);
    CHECK_INT(all.n_recalled + all.n_twice, 0);
    int n_look = all.n_looks, n_end = 0, n_late = 0, in_reference = 0;
    CHECK(n_look > 100);
    uint64_t state = 3;
    pal_err err = PAL_ERR_STATE;
    for (int k = 0; k < MAX_ENDS && err == PAL_ERR_STATE; k++) {
        /* ever later, so that the longest answer is found as well */
        int max = n_look / 100 + n_look * k / 50;
        int left = 1 + (int)random_below(&state, (uint64_t)max);
        /* with all configurations measured once more: every time they are timed again */
        if (parts.so_far->n_point == once->n_point && n_late++ > 0) left = -1;
        err = go(&parts, p, &beam, left, again);
        n_end += err == PAL_ERR_STATE;
        in_reference += err == PAL_ERR_STATE && parts.so_far->n_point == 0;
    }
    CHECK(err == PAL_ERR_OK);
    CHECK(n_end >= 10 && in_reference >= 4);
    CHECK_INT(parts.n_kept, 4);
    CHECK_INT(parts.n_twice, 0);
    for (int k = 0; k < parts.n_kept; k++) {
        CHECK(parts.kept[k].key == all.kept[k].key && parts.kept[k].answer.n_node == all.kept[k].answer.n_node);
        CHECK(!memcmp(parts.kept[k].value, all.kept[k].value, sizeof(double) * (size_t)all.kept[k].n));
    }
    check_same(again, once);
    printf(
        "  %d looks; ended %d times, %d of them before the first configuration; %d answers taken from what was kept\n",
        n_look, n_end, in_reference, parts.n_recalled);
    free(all.kept), free(all.so_far), free(parts.kept), free(parts.so_far);
    free(once), free(again), free(p);
    pal_surface_free(&beam);
}

int main(void)
{
    RUN(ended_anywhere_it_goes_on_to_the_same_table);
    return check_report();
}
