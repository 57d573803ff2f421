/* Sculpting commands that a scripted client sends at given times, from a file of lines
 *
 *     SECONDS VERB key=value ... [at=SIDE] [at2=SIDE]
 *
 * SECONDS count from the first cycle in the time of the session, and must not decrease. `?` before SECONDS allows a
 * refusal; `#` begins a comment. SIDE is top, bottom, front, back, left or right (+z -z -y +y -x +x of the scene): the
 * surface point on that side gives x_m y_m z_m, and with at2 x2_m y2_m z2_m. `target=NAME` names the body. A command
 * waits for the answer to the previous one. Thread: any. */
#ifndef PAL_SCRIPTED_CLIENT_ORDERS_H
#define PAL_SCRIPTED_CLIENT_ORDERS_H
#include "protocol/control.h"
#include "server/base/err.h"

enum { PAL_ORDERS_MAX = 4096 };

typedef enum pal_side {
    PAL_SIDE_NONE,
    PAL_SIDE_TOP,
    PAL_SIDE_BOTTOM,
    PAL_SIDE_FRONT,
    PAL_SIDE_BACK,
    PAL_SIDE_LEFT,
    PAL_SIDE_RIGHT,
    PAL_SIDE_COUNT
} pal_side;

typedef struct pal_order_line {
    int number; /* line number in the file */
    double t_s;
    bool may_fail;
    pal_side at[2];
    pal_wire_command order;
} pal_order_line;

typedef struct pal_orders {
    int n_line;
    pal_order_line *line; /* [n_line] owned */
} pal_orders;

/* result of one command; borrowed for the callback */
typedef struct pal_order_result {
    const pal_order_line *line;
    const pal_wire_answer *answer; /* NULL: refused */
    const char *text;              /* diagnostic of the server */
    double answer_ms;              /* from sending to the answer */
    double frame_ms;               /* to the first frame of another topology; 0: none */
    double gap_ms;                 /* longest interval between two cycles until then */
    double given_s, answered_s;    /* session time of the newest cycle then, from the first cycle */
    double moved_m; /* when it was given: largest displacement of a vertex of its body since the first frame of the
                     * topology */
    uint32_t epoch, n_vertex; /* of the first part now */
} pal_order_result;

pal_err pal_orders_load(pal_orders *orders, const char *path,
                        pal_diagnostic *diag); /* REFUSED: names file and line; IO */
void pal_orders_free(pal_orders *orders);
/* mean position of the vertices furthest to a side; false: no vertex */
bool pal_side_point(const float *x, uint32_t n_vertex, pal_side side, double out[3]);
/* the line's command with the positions of its sides; false: no vertex, or too many numbers */
bool pal_order_fill(const pal_order_line *line, const float *x, uint32_t n_vertex, pal_wire_command *out);
#endif
