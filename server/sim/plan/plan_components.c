/* The table of rows while a world runs: rows come and go between steps. */
#include "server/sim/plan/plan.h"
#include "server/sim/plan/plan_requests.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* of heap tables: the rows, then their bodies */
static size_t table_bytes(int n_row)
{
    return (size_t)n_row * (sizeof(pal_component) + sizeof(int));
}

/* the plan's tables are from now on those at `row`: the arena's own or heap */
static void change_tables(pal_plan *plan, pal_component *row, int *component_body, int n_row)
{
    if (plan->row != plan->load_component) free(plan->row);
    plan->row = row;
    plan->component_body = component_body;
    plan->n_row = n_row;
}

/* rows of this stage and body grow by `by`, all behind them move */
static void shift(pal_plan *plan, int stage, int body, int by)
{
    plan->n_of[stage][body] += by;
    for (int s = stage; s < PAL_STAGE_COUNT; s++)
        for (int b = 0; b < plan->n_body; b++)
            if (s > stage || b > body) plan->first[s][b] += by;
}

pal_err pal_plan_insert(pal_plan *plan, int body, const pal_component *row)
{
    int stage = row->effect->stage;
    return pal_plan_insert_at(plan, plan->first[stage][body] + plan->n_of[stage][body], body, row);
}

pal_err pal_plan_insert_at(pal_plan *plan, int at, int body, const pal_component *row)
{
    int stage = row->effect->stage, n = plan->n_row;
    pal_component *to = plan->row;
    int *to_body = plan->component_body;
    if (n >= plan->n_load) {
        to = malloc(table_bytes(n + 1));
        if (!to) return PAL_ERR_MEMORY;
        to_body = (int *)(void *)(to + n + 1);
        memcpy(to, plan->row, (size_t)at * sizeof *to);
        memcpy(to_body, plan->component_body, (size_t)at * sizeof *to_body);
    }
    memmove(to + at + 1, plan->row + at, (size_t)(n - at) * sizeof *to);
    memmove(to_body + at + 1, plan->component_body + at, (size_t)(n - at) * sizeof *to_body);
    to[at] = *row;
    to_body[at] = body;
    if (to != plan->row) change_tables(plan, to, to_body, n + 1);
    plan->n_row = n + 1;
    shift(plan, stage, body, 1);
    return PAL_ERR_OK;
}

void pal_plan_remove(pal_plan *plan, const void *self)
{
    int at = 0;
    while (at < plan->n_row && plan->row[at].self != self) at++;
    if (at == plan->n_row) return;
    int stage = plan->row[at].effect->stage, body = plan->component_body[at], n = plan->n_row - 1;
    pal_plan_destroy_component(&plan->row[at]);
    memmove(plan->row + at, plan->row + at + 1, (size_t)(n - at) * sizeof *plan->row);
    memmove(plan->component_body + at, plan->component_body + at + 1, (size_t)(n - at) * sizeof *plan->component_body);
    plan->n_row = n;
    shift(plan, stage, body, -1);
    if (n > plan->n_load || plan->row == plan->load_component) return;
    /* there is room in the arena's tables again */
    memcpy(plan->load_component, plan->row, (size_t)n * sizeof *plan->row);
    memcpy(plan->load_component_body, plan->component_body, (size_t)n * sizeof *plan->component_body);
    change_tables(plan, plan->load_component, plan->load_component_body, n);
}

size_t pal_plan_bytes(const pal_plan *plan)
{
    size_t n_byte = plan->row == plan->load_component ? 0 : table_bytes(plan->n_row);
    for (int i = 0; i < plan->n_row; i++)
        if (plan->row[i].arena) n_byte += pal_arena_used(plan->row[i].arena);
    for (int b = 0; b < plan->n_body; b++) n_byte += plan->body[b].dofs.n_byte;
    return n_byte;
}

size_t pal_plan_print(const pal_plan *plan, char *text, size_t n_byte)
{
    size_t used = 0;
    if (n_byte > 0) text[0] = 0;
    for (int i = 0; i < plan->n_row; i++) {
        size_t left = used < n_byte ? n_byte - used : 0;
        const pal_component *row = &plan->row[i];
        used += (size_t)snprintf(left ? text + used : NULL, left, "%-8s %-16s %-16s %9.1f kB\n",
                                 pal_stage_name(row->effect->stage), row->effect->name,
                                 plan->body[plan->component_body[i]].name, 1e-3 * (double)row->n_byte);
    }
    return used;
}
