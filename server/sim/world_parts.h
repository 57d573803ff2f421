/* What world.c, world_show.c, world_follow.c and transfer_carry.c share: the world's record. Private to these. */
#ifndef PAL_SIM_WORLD_PARTS_H
#define PAL_SIM_WORLD_PARTS_H
#include "server/sim/brush_rows.h"
#include "server/sim/ease.h"
#include "server/sim/field.h"
#include "server/sim/plan.h"
#include "server/sim/world.h"

/* shown surface of a body as at load */
typedef struct pal_world_part {
    int n_vertex, n_tri;
    float *rest_m;
    int32_t *tri;
    int32_t *parent; /* of midpoints, of a body that adapts; else NULL */
} pal_world_part;

struct pal_world {
    pal_arena *arena, *scratch;
    pal_plan plan;
    pal_tools tools;
    pal_pose asked[PAL_TOOL_MAX];
    bool has_asked[PAL_TOOL_MAX];
    uint64_t pose_ns[PAL_TOOL_MAX];
    pal_material material[PAL_BODY_MAX];
    pal_world_part part[PAL_BODY_MAX];
    double step_s, time_s, limit_s, rest_limit_s;
    int most_substep, n_substep;
    bool unwatched; /* nobody looks: OUTPUT rows are run only where tools need them */
    uint64_t tick, step_ns, end_ns;
    pal_err row_err;       /* of the first row that failed in this step */
    pal_field_rows fields; /* put in while the world runs */
    pal_brush_rows brushes;
    pal_ease_rows eases;
};

/* OUTPUT rows of all bodies, so that what is shown is where they are */
void pal_world_show_all(pal_world *world);

/* ", node 512 at (1, 2, 3) mm sets it": the node that the rows' bounds make responsible. Where bounds are of nodes that
 * are not the points, and without bounds, nothing. The forces' room is free between steps */
void pal_world_name_limit(const pal_world *world, char *text, size_t n_byte);

#endif
