#include "server/commands/preflight_report.h"

#include "server/base/log.h"
#include "server/cli/report.h"

#include <math.h>
#include <stdio.h>

void pal_preflight_print(const pal_preflight *preflight, double measured_ms)
{
    printf("\npreflight\n");
    for (int b = 0; b < preflight->n_body; b++) {
        char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE];
        int n = pal_preflight_describe(&preflight->body[b], line);
        for (int k = 0; k < n; k++) printf("  %s: %s\n", preflight->body[b].name, line[k]);
    }
    if (isfinite(preflight->predicted_ms))
        printf("  a step under load: %.3g ms predicted from counts, %.3g ms measured here at rest\n",
               preflight->predicted_ms, measured_ms);
}

static void add_weak(cJSON *o, const char *key, const pal_weak_spot *weak)
{
    cJSON *w = cJSON_AddObjectToObject(o, key);
    cJSON_AddNumberToObject(w, "count", weak->n);
    if (weak->n == 0) return;
    cJSON_AddNumberToObject(w, "worst", weak->worst);
    pal_json_add_finite(w, "value", weak->value);
    cJSON_AddItemToObject(w, "at_m", cJSON_CreateDoubleArray(weak->at_m, 3));
}

cJSON *pal_preflight_json(const pal_preflight *preflight)
{
    cJSON *o = cJSON_CreateObject(), *list = cJSON_AddArrayToObject(o, "bodies");
    pal_json_add_finite(o, "predicted_ms", preflight->predicted_ms);
    cJSON_AddNumberToObject(o, "world_bytes", (double)preflight->n_byte);
    for (int i = 0; i < preflight->n_body; i++) {
        const pal_preflight_body *b = &preflight->body[i];
        cJSON *body = cJSON_CreateObject();
        cJSON_AddItemToArray(list, body);
        cJSON_AddStringToObject(body, "name", b->name);
        cJSON_AddNumberToObject(body, "dofs", b->n_point);
        cJSON_AddNumberToObject(body, "elements", b->n_element);
        cJSON_AddNumberToObject(body, "fixed", b->n_fixed);
        pal_json_add_finite(body, "limit_s", b->limit_s);
        cJSON_AddNumberToObject(body, "substeps", b->n_sub);
        if (b->limit_node >= 0) {
            cJSON_AddNumberToObject(body, "limit_node", b->limit_node);
            cJSON_AddItemToObject(body, "limit_at_m", cJSON_CreateDoubleArray(b->limit_at_m, 3));
            pal_json_add_finite(body, "limit_edge_m", b->limit_edge_m);
        }
        add_weak(body, "short_edges", &b->edge);
        add_weak(body, "flat_elements", &b->flat);
        if (b->n_sliver > 0) cJSON_AddNumberToObject(body, "slivers", b->n_sliver);
        add_weak(body, "thin_elements", &b->thin);
        add_weak(body, "light_nodes", &b->light);
        if (b->locks) cJSON_AddStringToObject(body, "locks", b->locks);
        if (b->locks) cJSON_AddStringToObject(body, "alternative", b->instead);
        pal_json_add_finite(body, "condition", b->condition);
        pal_json_add_finite(body, "slowest_s", b->slowest_period_s);
        pal_json_add_finite(body, "predicted_ms", b->predicted_ms);
    }
    return o;
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
        if (body->locks)
            pal_log(PAL_LOG_WARN, "preflight", "%s: body %s: element %s locks at Poisson's ratio %.4g, %s does not",
                    scene, body->name, body->locks, body->poisson, body->instead);
    }
    pal_log(n_weak > 0 ? PAL_LOG_WARN : PAL_LOG_INFO, "preflight",
            "%s: %d sub-step%s a step, condition at least %.2g, %.1f MB, %d weak elements and nodes%s", scene, n_sub,
            n_sub == 1 ? "" : "s", condition, 1e-6 * (double)preflight->n_byte, n_weak,
            n_weak > 0 ? " (palpate plan lists them)" : "");
}
