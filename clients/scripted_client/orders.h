/* Orders of sculpting that a trainee gives at their times, from a file of lines
 *     SECONDS VERB key=value ... [at=SIDE] [at2=SIDE]
 * SECONDS since the first cycle, in order; `?` before SECONDS: it may be refused; `#` begins a comment. SIDE is top,
 * bottom, front, back, left or right (+z -z -y +y -x +x of the scene): there the surface is asked for x_m y_m z_m, with
 * at2 for x2_m y2_m z2_m. `target=NAME` names the body. An order waits until the one before has been answered.
 * Thread: any. */
#ifndef PAL_SCRIPTED_CLIENT_ORDERS_H
#define PAL_SCRIPTED_CLIENT_ORDERS_H
#include "protocol/control.h"
#include "server/base/err.h"

enum { PAL_ORDERS_MAX = 256 };

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
    int number; /* in the file */
    double t_s;
    bool may_fail;
    pal_side at[2];
    pal_wire_command order;
} pal_order_line;

typedef struct pal_orders {
    int n_line;
    pal_order_line *line; /* [n_line] owned */
} pal_orders;

/* what came of one; borrowed for the call that hands it out */
typedef struct pal_order_result {
    const pal_order_line *line;
    const pal_wire_answer *answer; /* NULL: refused              */
    const char *text;              /* the server's sentence       */
    double answer_ms;              /* from sending to the answer  */
    double frame_ms;               /* to the first frame of another topology, 0: there is none */
    double gap_ms;                 /* longest time between two cycles meanwhile */
    double moved_m;           /* most that a vertex of its body is now from its place in the topology's first frame */
    uint32_t epoch, n_vertex; /* of the first part now       */
} pal_order_result;

pal_err pal_orders_load(pal_orders *orders, const char *path,
                        pal_diagnostic *diag); /* REFUSED names file and line; IO */
void pal_orders_free(pal_orders *orders);
/* in the middle of the vertices that lie furthest to a side; false: no vertex */
bool pal_side_point(const float *x, uint32_t n_vertex, pal_side side, double out[3]);
/* the line's order with its sides' places filled in; false: no vertex, or too many numbers */
bool pal_order_fill(const pal_order_line *line, const float *x, uint32_t n_vertex, pal_wire_command *out);
#endif
