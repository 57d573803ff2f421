/* Constants of paper B's springs from an isotropic material: k = factor(nu) E h^3, joules, h the voxel edge; and the
 * part that the three spring rows share. Thread: [load], pal_spring_material [sim]. */
#ifndef PAL_SIM_SPRING_LAW_H
#define PAL_SIM_SPRING_LAW_H
#include "server/sim/effect.h"

typedef enum pal_spring_kind { PAL_SPRING_DISTANCE, PAL_SPRING_AREA, PAL_SPRING_VOLUME } pal_spring_kind;

/* constants of one row of springs: E = k/2 C^2, f = -(k C + c dC/dt) grad C with the dimensionless constraint C */
typedef struct pal_spring {
    pal_spring_kind kind;
    double k_J, c_Js;
    bool given; /* k_J stands in the scene: a material edit leaves it */
} pal_spring;

/* constraints a kernel computes at once; rows pad their arrays to a multiple of it */
enum { PAL_SPRING_CHUNK = 64 };

/* k of one kind of spring, J; positive for a material that pal_material_check passes */
double pal_spring_constant_J(pal_spring_kind kind, const pal_material *material, double h_m);
/* keys k_J (absent: derived), c_Js (0); no other key is allowed */
pal_err pal_spring_read(pal_spring_kind kind, pal_item *item, const pal_build *build, pal_spring *out);
void pal_spring_material(pal_spring *spring, const pal_body *body, const pal_material *material);
/* n rounded up to whole chunks */
size_t pal_spring_padded(int n);
#endif
