/* The three studies of tests/bench/README.md as they were measured (tests/data/studies, the same files as the plots are
 * drawn from): what is foreseen for a configuration from the others, against what was measured there; the front; what
 * is picked. Recorded milliseconds, so nothing here depends on the machine. */
#include "server/study/study_store.h"
#include "tests/check.h"

#include <stdint.h>

typedef struct record {
    const char *path;
    int n, within;      /* configurations measured; of them with cost foreseen within 30 %, at least */
    double error_share; /* of those with an error foreseen within a factor of 2, at least */
} record;

static const record records[] = {
    {"tests/data/studies/beam.json", 68, 64, 0.95},
    {"tests/data/studies/liver.json", 68, 64, 0.95},
    {"tests/data/studies/stomach.json", 5, 4, 0}, /* errors: too few for a law */
};

static pal_study_file *read_record(const record *r)
{
    pal_study_file *file = NULL;
    pal_diagnostic reason = {{0}};
    if (pal_study_file_read(r->path, &file, &reason)) CHECK_FAIL("%s", reason.text);
    return file;
}

static void cost_and_error_are_predicted_from_the_other_configurations(void)
{
    for (size_t k = 0; k < sizeof records / sizeof *records; k++) {
        pal_study_file *file = read_record(&records[k]);
        REQUIRE(file && file->whole);
        /* anyone can type it in the top folder of the tree */
        CHECK(!strstr(file->command, " /"));
        const pal_study *s = &file->study;
        int n = 0, cost = 0, error = 0;
        for (int i = 0; i < s->n_point; i++) {
            const pal_study_point *p = &s->point[i];
            double ms, error_m;
            if (p->err) continue;
            n++;
            if (!pal_study_predict_error(s, &p->measured.configuration, i, &error_m)) continue;
            CHECK(pal_study_predict_cost(s, &p->measured.configuration, p->n_node, p->n_element, p->n_substep,
                                         p->read_ms, i, &ms));
            /* as it stands in the record */
            CHECK_NEAR(p->predicted_ms, ms, 1e-6 * ms);
            cost += ms <= 1.3 * p->measured.ms && ms >= p->measured.ms / 1.3;
            error += error_m <= 2 * p->measured.error_m && error_m >= 0.5 * p->measured.error_m;
        }
        printf("  %s: of %d configurations cost within 30 %%: %d, error within a factor of 2: %d\n", s->name, n, cost,
               error);
        CHECK_INT(n, records[k].n);
        CHECK(cost >= records[k].within && error >= (int)(records[k].error_share * n));
        free(file);
    }
}

static void the_front_and_what_is_picked_are_of_these_numbers(void)
{
    pal_study_file *file = read_record(&records[0]);
    REQUIRE(file);
    pal_study *s = &file->study;
    bool was[PAL_STUDY_POINTS];
    for (int i = 0; i < s->n_point; i++) was[i] = s->point[i].measured.front;
    pal_study_mark_front(s);
    for (int i = 0; i < s->n_point; i++) {
        CHECK(was[i] == s->point[i].measured.front);
        /* fitted to the load that judges it */
        if (s->point[i].measured.configuration.k_distance_J > 0) CHECK(!was[i]);
    }
    int near = pal_study_pick(s, "", 1e-4, NAN), fast = pal_study_pick(s, "", NAN, 0.05);
    REQUIRE(near >= 0 && fast >= 0);
    const pal_measured_configuration *p = &s->point[near].measured, *q = &s->point[fast].measured;
    CHECK(p->front && p->error_m + s->reference_m <= 1e-4 && q->ms <= 0.05);
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *o = &s->point[i];
        if (o->err || o->reason[0]) continue;
        CHECK(o->measured.error_m + s->reference_m > 1e-4 || o->measured.ms >= p->ms);
        CHECK(o->measured.ms > 0.05 || o->measured.error_m >= q->error_m);
    }
    CHECK_INT(pal_study_pick(s, "", 1e-6, NAN), -1);
    free(file);
}

/* B-bar at the same nodes is nearer than full integration and that nearer than tetrahedra, at every size */
static void elements_are_in_the_order_of_numerics(void)
{
    pal_study_file *file = read_record(&records[0]);
    REQUIRE(file);
    static const int size[] = {16, 24, 32, 48};
    for (int k = 0; k < 4; k++) {
        double rms[3] = {NAN, NAN, NAN};
        static const char *const element[] = {"hex8_bbar", "hex8", "tet4"};
        for (int i = 0; i < file->study.n_point; i++) {
            const pal_study_point *p = &file->study.point[i];
            for (int e = 0; e < 3; e++)
                if (p->measured.configuration.size == size[k] &&
                    !strcmp(p->measured.configuration.element, element[e]) &&
                    !strcmp(p->measured.configuration.law, "corotational"))
                    rms[e] = p->static_rms_m;
        }
        CHECK(4 * rms[0] < rms[1] && 2 * rms[1] < rms[2]);
    }
    free(file);
}

int main(void)
{
    RUN(cost_and_error_are_predicted_from_the_other_configurations);
    RUN(the_front_and_what_is_picked_are_of_these_numbers);
    RUN(elements_are_in_the_order_of_numerics);
    return check_report();
}
