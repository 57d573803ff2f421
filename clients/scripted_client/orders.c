#include "clients/scripted_client/orders.h"
#include "server/base/vec3.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const side_name[PAL_SIDE_COUNT] = {"none", "top", "bottom", "front", "back", "left", "right"};

static pal_side find_side(const char *name)
{
    int side = PAL_SIDE_TOP;
    while (side < PAL_SIDE_COUNT && strcmp(name, side_name[side]) != 0) side++;
    return (pal_side)side;
}

/* one word of a line, "key=value"; false: why says what is wrong */
static bool read_word(pal_order_line *to, char *word, const char **reason)
{
    char *value = strchr(word, '=');
    *reason = "is not key=value";
    if (!value || value == word) return false;
    *value++ = 0;
    if (!strcmp(word, "target")) {
        *reason = "is too long";
        return (size_t)snprintf(to->order.target, sizeof to->order.target, "%s", value) < sizeof to->order.target;
    }
    if (!strcmp(word, "at") || !strcmp(word, "at2")) {
        *reason = "is no side: top, bottom, front, back, left or right";
        pal_side side = find_side(value);
        to->at[word[2] == '2'] = side;
        return side < PAL_SIDE_COUNT;
    }
    char *end = value;
    double number = strtod(value, &end);
    *reason = "is no number";
    if (end == value || *end || !isfinite(number)) return false;
    *reason = "is one number too many";
    if (to->order.n_arg == PAL_WIRE_ARG_MAX) return false;
    pal_wire_arg *arg = &to->order.arg[to->order.n_arg++];
    *reason = "has too long a name";
    arg->value = number;
    return (size_t)snprintf(arg->key, sizeof arg->key, "%s", word) < sizeof arg->key;
}

static pal_err read_line(pal_order_line *to, char *text, const char *path, pal_diagnostic *diag)
{
    const char *blank = " \t";
    char *rest = NULL, *end = NULL, *word;
    text += strspn(text, blank);
    to->may_fail = *text == '?';
    if (to->may_fail) text++;
    char *time = strtok_r(text, blank, &rest);
    to->t_s = time ? strtod(time, &end) : -1;
    if (!time || *end || !(to->t_s >= 0) || !isfinite(to->t_s))
        return PAL_REFUSE(diag, "%s:%d: wants `SECONDS VERB key=value ...`", path, to->number);
    const char *verb = strtok_r(NULL, blank, &rest);
    if (!verb || (size_t)snprintf(to->order.verb, sizeof to->order.verb, "%s", verb) >= sizeof to->order.verb)
        return PAL_REFUSE(diag, "%s:%d: has no verb", path, to->number);
    while ((word = strtok_r(NULL, blank, &rest))) {
        const char *reason;
        char shown[48];
        snprintf(shown, sizeof shown, "%.40s", word);
        if (!read_word(to, word, &reason)) return PAL_REFUSE(diag, "%s:%d: \"%s\" %s", path, to->number, shown, reason);
    }
    return PAL_ERR_OK;
}

pal_err pal_orders_load(pal_orders *orders, const char *path, pal_diagnostic *diag)
{
    *orders = (pal_orders){.line = calloc(PAL_ORDERS_MAX, sizeof *orders->line)};
    if (!orders->line) return PAL_ERR_MEMORY;
    FILE *file = fopen(path, "r");
    pal_err err = file ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    char text[512];
    for (int number = 1; !err && fgets(text, sizeof text, file); number++) {
        bool whole = strchr(text, '\n') || feof(file);
        text[strcspn(text, "#\r\n")] = 0;
        if (text[strspn(text, " \t")] == 0 && whole) continue;
        pal_order_line *to = &orders->line[orders->n_line];
        if (!whole)
            err = PAL_REFUSE(diag, "%s:%d: is longer than %zu bytes", path, number, sizeof text - 2);
        else if (orders->n_line == PAL_ORDERS_MAX)
            err = PAL_REFUSE(diag, "%s:%d: more than %d orders", path, number, PAL_ORDERS_MAX);
        if (err) break;
        to->number = number;
        err = read_line(to, text, path, diag);
        if (!err && orders->n_line > 0 && to->t_s < to[-1].t_s)
            err = PAL_REFUSE(diag, "%s:%d: time %g s is before the line above", path, number, to->t_s);
        orders->n_line++;
    }
    if (file) fclose(file);
    if (!err && orders->n_line < 1) err = PAL_REFUSE(diag, "%s: has no order", path);
    if (err) pal_orders_free(orders);
    return err;
}

void pal_orders_free(pal_orders *orders)
{
    free(orders->line);
    *orders = (pal_orders){.n_line = 0};
}

bool pal_side_point(const float *x, uint32_t n_vertex, pal_side side, double out[3])
{
    static const int axis_of[PAL_SIDE_COUNT] = {0, 2, 2, 1, 1, 0, 0},
                     sign_of[PAL_SIDE_COUNT] = {0, 1, -1, -1, 1, -1, 1};
    const int axis = axis_of[side], sign = sign_of[side];
    double low = INFINITY, high = -INFINITY, mean[3] = {0, 0, 0}, best = INFINITY;
    int n = 0;
    for (uint32_t i = 0; i < n_vertex; i++) {
        double along = sign * (double)x[3 * (size_t)i + (size_t)axis];
        low = fmin(low, along), high = fmax(high, along);
    }
    const double edge = high - 0.02 * (high - low);
    for (uint32_t i = 0; i < n_vertex; i++) {
        const double at[3] = {x[3 * (size_t)i], x[3 * (size_t)i + 1], x[3 * (size_t)i + 2]};
        if (sign * at[axis] < edge) continue;
        n++;
        pal_axpy3(mean, 1, at);
    }
    if (n == 0) return false;
    pal_scale3(mean, 1.0 / n, mean);
    /* of these the vertex that is nearest to their mean */
    for (uint32_t i = 0; i < n_vertex; i++) {
        const double at[3] = {x[3 * (size_t)i], x[3 * (size_t)i + 1], x[3 * (size_t)i + 2]};
        if (sign * at[axis] < edge || pal_dist3(at, mean) >= best) continue;
        best = pal_dist3(at, mean);
        pal_copy3(out, at);
    }
    return true;
}

bool pal_order_fill(const pal_order_line *line, const float *x, uint32_t n_vertex, pal_wire_command *out)
{
    static const char *const key[2][3] = {{"x_m", "y_m", "z_m"}, {"x2_m", "y2_m", "z2_m"}};
    double at[3];
    *out = line->order;
    for (int k = 0; k < 2; k++) {
        if (line->at[k] == PAL_SIDE_NONE) continue;
        if (!pal_side_point(x, n_vertex, line->at[k], at) || out->n_arg + 3 > PAL_WIRE_ARG_MAX) return false;
        for (int c = 0; c < 3; c++) {
            pal_wire_arg *to = &out->arg[out->n_arg++];
            snprintf(to->key, sizeof to->key, "%s", key[k][c]);
            to->value = at[c];
        }
    }
    return true;
}
