/* Sculpting. A shape is the unit of undo: cells, strokes, and the mechanical state at the time it was replaced. An
 * edit contains the new shape, a scene with its own copies, and memory for the replaced state. */
#include "server/session/sculpt.h"

#include "server/base/vec3.h"
#include "server/sim/transfer/transfer_world.h"

#include <stdlib.h>
#include <string.h>

typedef struct shape {
    pal_cells cells;
    pal_stroke *stroke; /* [n_stroke] */
    int n_stroke;
    double *x, *v; /* state when it was replaced; NULL: never replaced [cells.n_vertex][3] */
} shape;

/* as in pal_body_def */
typedef struct cut_plane {
    bool cut;
    double normal[3], at_m;
} cut_plane;

struct pal_sculptor {
    int body;
    double origin_m[3]; /* of the body's frame, independent of the shape */
    cut_plane cut;
    shape now, past[PAL_SCULPT_HISTORY], future[PAL_SCULPT_HISTORY]; /* newest last */
    int n_past, n_future;
};

struct pal_sculpt_edit {
    pal_sculpt_kind kind;
    int body;
    const pal_cells *from;     /* the sculptor's, until commit */
    shape to;                  /* after the command; moved to the sculptor by commit */
    pal_cells_edit cells_edit; /* CELLS: origin of the new points */
    double *x, *v;             /* replaced state [points before] */
    double *next_x, *next_v;   /* new state [points after] */
    int n_before;
    cut_plane cut;
    /* the scene and what its body borrows */
    pal_scene scene;
    shape shown; /* a copy of `to` */
    pal_prepared mesh;
};

static void free_shape(shape *s)
{
    pal_cells_free(&s->cells);
    free(s->stroke);
    free(s->x);
    free(s->v);
    *s = (shape){.n_stroke = 0};
}

static void *copied(const void *from, size_t n_byte)
{
    void *to = malloc(n_byte ? n_byte : 1);
    if (to && n_byte) memcpy(to, from, n_byte);
    return to;
}

/* copies cells and strokes, without the state */
static pal_err copy_shape(const shape *from, shape *to)
{
    *to = (shape){.n_stroke = from->n_stroke};
    to->stroke = copied(from->stroke, sizeof *to->stroke * (size_t)from->n_stroke);
    pal_err err = to->stroke ? pal_cells_copy(&from->cells, &to->cells) : PAL_ERR_MEMORY;
    if (err) free_shape(to);
    return err;
}

/* pushes a shape on a list; a full list drops the oldest */
static void push(shape *list, int *n, const shape *s)
{
    if (*n == PAL_SCULPT_HISTORY) {
        free_shape(&list[0]);
        memmove(list, list + 1, sizeof *list * (size_t)(PAL_SCULPT_HISTORY - 1));
        --*n;
    }
    list[(*n)++] = *s;
}

pal_err pal_sculptor_create(const pal_scene *scene, int body, pal_diagnostic *diag, pal_sculptor **out)
{
    if (body < 0 || body >= scene->n_body || !scene->body[body].cells)
        return PAL_REFUSE(diag, "body %d is no solid of control cells", body);
    pal_sculptor *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    const pal_body_def *def = &scene->body[body];
    s->body = body;
    pal_copy3(s->origin_m, def->mesh->surface.origin_m);
    s->cut = (cut_plane){def->cut, {def->cut_normal[0], def->cut_normal[1], def->cut_normal[2]}, def->cut_m};
    shape from = {.cells = *def->cells, .n_stroke = def->n_stroke};
    from.stroke = (pal_stroke *)(uintptr_t)def->stroke;
    pal_err err = copy_shape(&from, &s->now);
    if (err)
        free(s);
    else
        *out = s;
    return err;
}

void pal_sculptor_destroy(pal_sculptor *sculptor)
{
    if (!sculptor) return;
    free_shape(&sculptor->now);
    for (int i = 0; i < sculptor->n_past; i++) free_shape(&sculptor->past[i]);
    for (int i = 0; i < sculptor->n_future; i++) free_shape(&sculptor->future[i]);
    free(sculptor);
}

const pal_cells *pal_sculptor_cells(const pal_sculptor *sculptor)
{
    return &sculptor->now.cells;
}

int pal_sculptor_undo_count(const pal_sculptor *sculptor)
{
    return sculptor->n_past;
}

int pal_sculptor_redo_count(const pal_sculptor *sculptor)
{
    return sculptor->n_future;
}

static pal_err paint(const pal_sculptor *s, const pal_stroke *stroke, shape *to, pal_diagnostic *diag)
{
    PAL_TRY(pal_stroke_check(stroke, diag));
    if (s->now.n_stroke >= PAL_STROKE_MAX)
        return PAL_REFUSE(diag, "there are %d strokes already, the most there may be", s->now.n_stroke);
    PAL_TRY(copy_shape(&s->now, to));
    pal_stroke *more = realloc(to->stroke, sizeof *more * (size_t)(to->n_stroke + 1));
    if (!more) return PAL_ERR_MEMORY;
    to->stroke = more;
    to->stroke[to->n_stroke++] = *stroke;
    return PAL_ERR_OK;
}

static pal_err keep(const pal_sculptor *s, const pal_sculpt *command, shape *to, pal_diagnostic *diag)
{
    const pal_cells *cells = &s->now.cells;
    pal_cells_fault fault;
    if (!command->point_m || command->n_point != cells->n_vertex)
        return PAL_REFUSE(diag, "%d points of the shape to be kept, wanted %d", command->n_point, cells->n_vertex);
    for (int i = 0; i < 3 * command->n_point; i++)
        if (!(fabs(command->point_m[i]) <= 1e9))
            return PAL_REFUSE(diag, "point %d of the shape to be kept is at %g m", i / 3, command->point_m[i]);
    if (!pal_cells_shape_valid(cells, command->point_m, &fault))
        return PAL_REFUSE(diag, "the shape as it is cannot be kept: control cell %d is folded over (%s %g)", fault.cell,
                          fault.face_use < 0 ? "volume" : "area", fault.measure);
    PAL_TRY(copy_shape(&s->now, to));
    memcpy(to->cells.x, command->point_m, 3 * sizeof(double) * (size_t)cells->n_vertex);
    return PAL_ERR_OK;
}

/* undo or redo: the shape with the state at its replacement */
static pal_err restore_shape(const shape *list, int n, const char *what, pal_sculpt_edit *edit, pal_diagnostic *diag)
{
    if (n == 0) return PAL_REFUSE(diag, "there is nothing to %s", what);
    const shape *from = &list[n - 1];
    size_t n_byte = 3 * sizeof(double) * (size_t)from->cells.n_vertex;
    PAL_TRY(copy_shape(from, &edit->to));
    if (!from->x) return PAL_ERR_OK;
    edit->next_x = copied(from->x, n_byte);
    edit->next_v = copied(from->v, n_byte);
    return edit->next_x && edit->next_v ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err set_cut(const pal_sculptor *s, const pal_sculpt *command, pal_sculpt_edit *edit, pal_diagnostic *diag)
{
    double length = pal_norm3(command->cut_normal);
    edit->cut.cut = command->cut;
    if (command->cut && !(length > 1e-12 && length < 1e12 && fabs(command->cut_m) <= 1e9))
        return PAL_REFUSE(diag, "a cut has a direction and an offset: %g %g %g at %g m", command->cut_normal[0],
                          command->cut_normal[1], command->cut_normal[2], command->cut_m);
    if (command->cut) pal_scale3(edit->cut.normal, 1 / length, command->cut_normal);
    edit->cut.at_m = command->cut_m;
    return copy_shape(&s->now, &edit->to);
}

static pal_err execute(const pal_sculptor *s, const pal_sculpt *command, pal_sculpt_edit *edit, pal_diagnostic *diag)
{
    shape from;
    switch (command->kind) {
    case PAL_SCULPT_CELLS:
        PAL_TRY(pal_cells_apply(&s->now.cells, &command->cells, &edit->cells_edit, diag));
        from = (shape){.cells = edit->cells_edit.cells, .stroke = s->now.stroke, .n_stroke = s->now.n_stroke};
        return copy_shape(&from, &edit->to);
    case PAL_SCULPT_PAINT:
        return paint(s, &command->stroke, &edit->to, diag);
    case PAL_SCULPT_SET_REST:
        return keep(s, command, &edit->to, diag);
    case PAL_SCULPT_CUT:
        return set_cut(s, command, edit, diag);
    case PAL_SCULPT_UNDO:
        return restore_shape(s->past, s->n_past, "undo", edit, diag);
    case PAL_SCULPT_REDO:
        return restore_shape(s->future, s->n_future, "redo", edit, diag);
    case PAL_SCULPT_KINDS:
        break;
    }
    return PAL_REFUSE(diag, "there is no sculpting command %d", (int)command->kind);
}

/* builds the scene with the body's new shape; the edit owns all that the body borrows */
static pal_err make_scene(const pal_sculptor *s, const pal_scene *scene, pal_sculpt_edit *edit)
{
    pal_surface surface = {0};
    edit->scene = *scene;
    pal_body_def *def = &edit->scene.body[s->body];
    PAL_TRY(copy_shape(&edit->to, &edit->shown));
    PAL_TRY(pal_cells_boundary(&edit->shown.cells, &surface, NULL, NULL));
    /* the body's frame does not move */
    pal_copy3(surface.origin_m, s->origin_m);
    pal_err err = pal_prepared_surface(&surface, &edit->mesh);
    pal_surface_free(&surface);
    def->cells = &edit->shown.cells;
    def->stroke = edit->shown.stroke, def->n_stroke = edit->shown.n_stroke;
    def->mesh = &edit->mesh;
    def->cut = edit->cut.cut, def->cut_m = edit->cut.at_m;
    pal_copy3(def->cut_normal, edit->cut.normal);
    return err;
}

static pal_err make_room(const pal_sculptor *s, pal_sculpt_edit *edit)
{
    size_t before = 3 * sizeof(double) * (size_t)s->now.cells.n_vertex;
    size_t after = 3 * sizeof(double) * (size_t)edit->to.cells.n_vertex;
    edit->n_before = s->now.cells.n_vertex;
    /* at rest, until a state is transferred */
    edit->x = copied(s->now.cells.x, before), edit->v = calloc(1, before);
    if (!edit->next_x) edit->next_x = calloc(1, after), edit->next_v = calloc(1, after);
    bool all = edit->x && edit->v && edit->next_x && edit->next_v;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_sculptor_prepare(const pal_sculptor *sculptor, const pal_scene *scene, const pal_sculpt *command,
                             pal_diagnostic *diag, pal_sculpt_edit **out)
{
    const pal_sculptor *s = sculptor;
    pal_sculpt_edit *edit = calloc(1, sizeof *edit);
    if (!edit) return PAL_ERR_MEMORY;
    *edit = (pal_sculpt_edit){.kind = command->kind, .from = &s->now.cells, .body = s->body, .cut = s->cut};
    pal_err err = execute(s, command, edit, diag);
    if (!err) err = make_room(s, edit);
    if (!err) err = make_scene(s, scene, edit);
    if (err)
        pal_sculpt_edit_free(edit);
    else
        *out = edit;
    return err;
}

const pal_scene *pal_sculpt_edit_scene(const pal_sculpt_edit *edit)
{
    return &edit->scene;
}

/* current positions and velocities of an edit's points */
static void carry_points(pal_sculpt_edit *edit)
{
    const pal_cells_edit *cells_edit = &edit->cells_edit;
    pal_cells_edit_positions(cells_edit, edit->from, edit->x, edit->next_x);
    pal_interpolation_apply(&cells_edit->rows, edit->v, edit->next_v);
}

void pal_sculpt_transfer(void *user, pal_world *next, const pal_world *before)
{
    pal_sculpt_edit *edit = user;
    const pal_body *from = pal_world_body((pal_world *)(uintptr_t)before, edit->body);
    size_t n_byte = 3 * sizeof(double) * (size_t)edit->n_before;
    memcpy(edit->x, from->x, n_byte);
    memcpy(edit->v, from->v, n_byte);
    bool back = edit->kind == PAL_SCULPT_UNDO || edit->kind == PAL_SCULPT_REDO;
    if (edit->kind == PAL_SCULPT_CELLS) {
        carry_points(edit);
    } else if (!back) {
        memcpy(edit->next_x, edit->x, n_byte);
        memcpy(edit->next_v, edit->v, n_byte);
    }
    pal_world_transfer(next, before, edit->body, edit->next_x, edit->next_v);
    pal_world_transfer_loads(next, edit->body, from, NULL);
}

void pal_sculptor_commit(pal_sculptor *sculptor, pal_sculpt_edit *edit)
{
    pal_sculptor *s = sculptor;
    s->cut = edit->cut;
    if (edit->kind == PAL_SCULPT_CUT) return;
    shape left = s->now;
    left.x = edit->x, left.v = edit->v;
    edit->x = edit->v = NULL;
    s->now = edit->to;
    edit->to = (shape){.n_stroke = 0};
    if (edit->kind == PAL_SCULPT_UNDO) {
        free_shape(&s->past[--s->n_past]);
        push(s->future, &s->n_future, &left);
        return;
    }
    if (edit->kind == PAL_SCULPT_REDO) {
        free_shape(&s->future[--s->n_future]);
    } else {
        while (s->n_future > 0) free_shape(&s->future[--s->n_future]);
    }
    push(s->past, &s->n_past, &left);
}

void pal_sculpt_edit_free(pal_sculpt_edit *edit)
{
    if (!edit) return;
    free_shape(&edit->to);
    pal_cells_edit_free(&edit->cells_edit);
    free(edit->x), free(edit->v), free(edit->next_x), free(edit->next_v);
    free_shape(&edit->shown);
    pal_prepared_free(&edit->mesh);
    free(edit);
}

static double off_edge(const pal_cells *c, int32_t edge, const double at[3])
{
    const double *a = c->x + 3 * (size_t)c->edge[edge].vertex[0], *b = c->x + 3 * (size_t)c->edge[edge].vertex[1];
    double ab[3], ap[3], near[3];
    pal_sub3(ab, b, a);
    pal_sub3(ap, at, a);
    double t = pal_dot3(ap, ab) / pal_dot3(ab, ab);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    pal_copy3(near, a);
    pal_axpy3(near, t, ab);
    return pal_dist3(near, at);
}

void pal_sculpt_find(const pal_cells *cells, int32_t face, const double at_m[3], pal_cells_command *out)
{
    const pal_cells *c = cells;
    int32_t first;
    double min_edge = INFINITY, min_vertex = INFINITY;
    out->face = face;
    out->cell = out->edge = out->vertex = -1;
    if (face < 0 || face >= c->n_face) return;
    out->cell = c->face_use[c->face[face].use[0]].cell;
    int32_t n = pal_cells_face_loop(c, face, &first);
    for (int32_t use = first; use < first + n; use++) {
        const pal_edge_use *u = &c->edge_use[use];
        double off_vertex = pal_dist3(c->x + 3 * (size_t)u->vertex, at_m), off = off_edge(c, u->edge, at_m);
        if (off < min_edge) min_edge = off, out->edge = u->edge;
        if (off_vertex < min_vertex) min_vertex = off_vertex, out->vertex = u->vertex;
    }
}
