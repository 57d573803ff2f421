#include "server/commands/preflight_report.h"

#include "server/base/log.h"
#include "server/cli/report.h"

#include <math.h>
#include <stdio.h>

enum { UNEVEN = 2 }; /* ratio of the sub-steps of two bodies from which it is worth a sentence */

/* what it costs that all bodies take the sub-steps of one; false: nothing that is worth a sentence */
static bool describe_shared(const pal_preflight *preflight, char line[PAL_PREFLIGHT_LINE])
{
    const pal_preflight_body *high = &preflight->body[0], *low = high;
    for (int b = 1; b < preflight->n_body; b++) {
        if (preflight->body[b].n_sub > high->n_sub) high = &preflight->body[b];
        if (preflight->body[b].n_sub < low->n_sub) low = &preflight->body[b];
    }
    if (preflight->n_body < 2 || high->n_sub < UNEVEN * low->n_sub) return false;
    snprintf(
        line, PAL_PREFLIGHT_LINE,
        "all bodies take the %d sub-steps of %s, %s alone would take %d: a lower resolution of %s, or model fem for "
        "it, makes all faster",
        high->n_sub, high->name, low->name, low->n_sub, high->name);
    return true;
}

void pal_preflight_print(const pal_preflight *preflight, double measured_ms)
{
    printf("\npreflight\n");
    for (int b = 0; b < preflight->n_body; b++) {
        char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE];
        int n = pal_preflight_describe(&preflight->body[b], line);
        for (int k = 0; k < n; k++) printf("  %s: %s\n", preflight->body[b].name, line[k]);
    }
    char shared[PAL_PREFLIGHT_LINE];
    if (describe_shared(preflight, shared)) printf("  %s\n", shared);
    if (isfinite(preflight->predicted_ms))
        printf("  a step under load: %.3g ms predicted, %.3g ms measured here at rest\n", preflight->predicted_ms,
               measured_ms);
}

static cJSON *weak_json(const pal_weak_spot *weak)
{
    if (weak->n == 0) return PAL_JSON({"count", JSON_NUMBER(0)});
    return PAL_JSON({"count", JSON_NUMBER(weak->n)}, {"worst", JSON_NUMBER(weak->worst)},
                    {"value", pal_json_finite(weak->value)}, {"at_m", cJSON_CreateDoubleArray(weak->at_m, 3)});
}

static cJSON *body_json(const pal_preflight_body *b)
{
    bool limited = b->limit_node >= 0;
    return PAL_JSON(
        {"name", JSON_TEXT(b->name)}, {"dofs", JSON_NUMBER(b->n_point)}, {"elements", JSON_NUMBER(b->n_element)},
        {"fixed", JSON_NUMBER(b->n_fixed)}, {"limit_s", pal_json_finite(b->limit_s)},
        {"substeps", JSON_NUMBER(b->n_sub)}, {"limit_node", limited ? JSON_NUMBER(b->limit_node) : NULL},
        {"limit_at_m", limited ? cJSON_CreateDoubleArray(b->limit_at_m, 3) : NULL},
        {"limit_edge_m", limited ? pal_json_finite(b->limit_edge_m) : NULL}, {"short_edges", weak_json(&b->edge)},
        {"flat_elements", weak_json(&b->flat)}, {"slivers", b->n_sliver > 0 ? JSON_NUMBER(b->n_sliver) : NULL},
        {"thin_elements", weak_json(&b->thin)}, {"light_nodes", weak_json(&b->light)},
        {"locks", b->locks ? JSON_TEXT(b->locks) : NULL}, {"alternative", b->locks ? JSON_TEXT(b->instead) : NULL},
        {"condition", pal_json_finite(b->condition)}, {"slowest_s", pal_json_finite(b->slowest_period_s)},
        {"lowest_1_s", pal_json_finite(b->omega_min_1_s)}, {"return_s", pal_json_finite(b->return_s)},
        {"predicted_ms", pal_json_finite(b->predicted_ms)});
}

cJSON *pal_preflight_json(const pal_preflight *preflight)
{
    cJSON *list = cJSON_CreateArray();
    for (int i = 0; i < preflight->n_body; i++) cJSON_AddItemToArray(list, body_json(&preflight->body[i]));
    return PAL_JSON({"bodies", list}, {"predicted_ms", pal_json_finite(preflight->predicted_ms)},
                    {"world_bytes", JSON_NUMBER(preflight->n_byte)});
}

void pal_preflight_log(const pal_preflight *preflight, const char *scene)
{
    int n_weak = 0, n_sub = 1;
    double condition = 0;
    for (int b = 0; b < preflight->n_body; b++) {
        const pal_preflight_body *body = &preflight->body[b];
        n_weak += body->edge.n + body->flat.n + body->thin.n + body->light.n;
        if (body->n_sub > n_sub) n_sub = body->n_sub;
        if (body->condition > condition) condition = body->condition;
        if (body->slow[0]) pal_log(PAL_LOG_WARN, "preflight", "%s: body %s: %s", scene, body->name, body->slow);
        if (body->locks)
            pal_log(PAL_LOG_WARN, "preflight", "%s: body %s: element %s locks at Poisson's ratio %.4g, %s does not",
                    scene, body->name, body->locks, body->poisson, body->instead);
    }
    char shared[PAL_PREFLIGHT_LINE];
    if (describe_shared(preflight, shared)) pal_log(PAL_LOG_WARN, "preflight", "%s: %s", scene, shared);
    pal_log(n_weak > 0 ? PAL_LOG_WARN : PAL_LOG_DEBUG, "preflight",
            "%s: %d sub-step%s a step, condition %.2g, %.1f MB, %d weak elements and nodes%s", scene, n_sub,
            n_sub == 1 ? "" : "s", condition, 1e-6 * (double)preflight->n_byte, n_weak,
            n_weak > 0 ? " (palpate plan lists them)" : "");
}
