/* Recovery of stress at nodes, and the error estimate from it. */
#include "server/sim/world/zz_estimator.h"

#include "server/sim/world/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_MATERIAL = 16 };

/* state of the passes over all stress points */
typedef struct recovery {
    double mu[MAX_MATERIAL], lambda[MAX_MATERIAL];
    int n_material, material; /* material: the present one */
    double *sum, *volume;     /* [n_node][9], [n_node]                */
    double *share;            /* NULL: not requested */
    double error2, solution2;
} recovery;

static double apart(double a, double b)
{
    return a > b ? a / b : b / a;
}

/* the material of a point, a new one while there is room; lambda may be near 0 or negative */
static int material_of(recovery *r, const pal_stress_point *p)
{
    double min = INFINITY, kappa = p->lambda_Pa + 2 * p->mu_Pa / 3;
    int nearest = 0;
    for (int k = 0; k < r->n_material; k++) {
        double off = fmax(apart(p->mu_Pa, r->mu[k]), apart(kappa, r->lambda[k] + 2 * r->mu[k] / 3));
        if (off < min) min = off, nearest = k;
    }
    if (min <= PAL_SAME_MATERIAL || r->n_material == MAX_MATERIAL) return nearest;
    r->mu[r->n_material] = p->mu_Pa, r->lambda[r->n_material] = p->lambda_Pa;
    return r->n_material++;
}

static void list_materials(void *user, const pal_stress_point *p)
{
    (void)material_of(user, p);
}

/* all points of an element add to all of its nodes alike: their sum is the element's mean */
static void gather(void *user, const pal_stress_point *p)
{
    recovery *r = user;
    if (material_of(r, p) != r->material) return;
    for (int c = 0; c < p->n_corner; c++) {
        double *sum = r->sum + 9 * (size_t)p->node[c];
        for (int i = 0; i < 9; i++) sum[i] += p->volume_m3 * p->stress[i];
        r->volume[p->node[c]] += p->volume_m3;
    }
}

/* s : C^-1 : s */
static double complementary(const double s[9], double mu, double lambda)
{
    double trace = s[0] + s[4] + s[8], square = 0;
    for (int i = 0; i < 9; i++) {
        double deviator = s[i] - (i % 4 == 0 ? trace / 3 : 0);
        square += deviator * deviator;
    }
    return square / (2 * mu) + trace * trace / (9 * (lambda + 2 * mu / 3));
}

static void compare(void *user, const pal_stress_point *p)
{
    recovery *r = user;
    double off[9];
    if (material_of(r, p) != r->material) return;
    for (int i = 0; i < 9; i++) off[i] = -p->stress[i];
    for (int c = 0; c < p->n_corner; c++)
        for (int i = 0; i < 9; i++) off[i] += p->shape[c] * r->sum[9 * (size_t)p->node[c] + (size_t)i];
    double error2 = p->volume_m3 * complementary(off, p->mu_Pa, p->lambda_Pa);
    r->error2 += error2;
    r->solution2 += p->volume_m3 * complementary(p->stress, p->mu_Pa, p->lambda_Pa);
    if (r->share) r->share[p->element] += error2;
}

static void recover(recovery *r, const pal_component *component, const pal_body *body)
{
    size_t n = (size_t)body->n_node;
    (void)component->effect->energy(component->self, body); /* components update their rotations with it */
    component->effect->inspect.stress(component->self, body, list_materials, r);
    for (r->material = 0; r->material < r->n_material; r->material++) {
        memset(r->sum, 0, 9 * n * sizeof *r->sum);
        memset(r->volume, 0, n * sizeof *r->volume);
        component->effect->inspect.stress(component->self, body, gather, r);
        for (size_t i = 0; i < 9 * n; i++)
            if (r->volume[i / 9] > 0) r->sum[i] /= r->volume[i / 9];
        component->effect->inspect.stress(component->self, body, compare, r);
    }
}

pal_err pal_zz_estimator_estimate(const pal_world *world, int body, double *share_J, pal_zz_estimator_error *out,
                                  pal_diagnostic *diag)
{
    const pal_body *at = pal_world_view_body(world, body);
    const pal_component *found = NULL; /* the first one of the body that gives stress */
    for (int i = 0; i < pal_world_component_count(world) && !found; i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        const pal_component *component = pal_world_component(world, i);
        if (info.body == at->name && component->effect->inspect.stress) found = component;
    }
    *out = (pal_zz_estimator_error){.error = NAN, .solution = NAN, .percent = NAN};
    if (!found) return PAL_REFUSE(diag, "body \"%s\": none of its rows gives stress in elements", at->name);
    recovery r = {.share = share_J};
    r.sum = malloc(9 * sizeof *r.sum * (size_t)at->n_node);
    r.volume = malloc(sizeof *r.volume * (size_t)at->n_node);
    pal_err err =
        r.sum && r.volume ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory to recover stress");
    if (!err) {
        recover(&r, found, at);
        double all = r.error2 + r.solution2;
        *out = (pal_zz_estimator_error){.error = sqrt(r.error2),
                                        .solution = sqrt(r.solution2),
                                        .percent = all > 0 ? 100 * sqrt(r.error2 / all) : 0,
                                        .n_material = r.n_material};
    }
    free(r.sum);
    free(r.volume);
    return err;
}
