#include "server/num/panels.h"

#include "server/base/heap.h"

#include <stdlib.h>
#include <string.h>

/* points in the next panel of a supernode with n points to go: four, and no single one behind four */
static int next_width(int n)
{
    return n <= 4 ? n : n == 5 ? 3 : 4;
}

/* s holds three rows for each point, in order */
static bool in_threes(const int *s, int n)
{
    if (n % 3) return false;
    for (int i = 0; i < n; i += 3)
        if (s[i] % 3 || s[i + 1] != s[i] + 1 || s[i + 2] != s[i] + 2) return false;
    return true;
}

static pal_err fill_pattern(const int *super, const int *pi, const int *s, pal_panels *p)
{
    for (int i = 0; i <= p->n_super; i++) p->first[i] = super[i] / 3, p->start[i] = pi[i] / 3;
    for (int i = 0; i < p->n_super; i++) {
        int n_col = p->first[i + 1] - p->first[i], n_row = (int)(p->start[i + 1] - p->start[i]);
        if (super[i] % 3 || pi[i] % 3 || n_col < 1 || !in_threes(s + pi[i], pi[i + 1] - pi[i])) return PAL_ERR_INTERNAL;
        for (int k = 0; k < n_row; k++) p->row[p->start[i] + k] = s[pi[i] + 3 * k] / 3;
        if (3 * n_row > p->max_row) p->max_row = 3 * n_row;
        for (int c = 0, m; c < n_col; c += m) {
            m = next_width(n_col - c);
            p->width[p->n_panel++] = (uint8_t)m;
            p->n_value[0] += 4 * pal_panel_vectors(3 * m, 3 * (n_row - c - m), 4);
            p->n_value[1] += 8 * pal_panel_vectors(3 * m, 3 * (n_row - c - m), 8);
        }
    }
    return PAL_ERR_OK;
}

pal_err pal_panels_make(int n_super, const int *super, const int *pi, const int *s, pal_panels *out)
{
    pal_panels p = {.n_point = super[n_super] / 3, .n_super = n_super};
    p.first = malloc(sizeof *p.first * ((size_t)n_super + 1));
    p.start = malloc(sizeof *p.start * ((size_t)n_super + 1));
    p.row = malloc(sizeof *p.row * ((size_t)pi[n_super] / 3 + 1));
    p.width = malloc((size_t)p.n_point + 1);
    pal_err err = p.first && p.start && p.row && p.width ? fill_pattern(super, pi, s, &p) : PAL_ERR_MEMORY;
    if (err)
        pal_panels_free(&p);
    else
        *out = p;
    return err;
}

void pal_panels_free(pal_panels *p)
{
    PAL_FREE(p->first, p->start, p->row, p->width);
    memset(p, 0, sizeof *p);
}
