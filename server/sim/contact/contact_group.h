/* Contacts of one tool grouped by direction, which become its haptic patches. A group spans 75 degrees about its mean
 * direction: a sphere in a dent touches tissue over its whole cap, which is one patch; the two walls of a fold are two
 * patches, whose forces add. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_CONTACT_GROUP_H
#define PAL_SIM_CONTACT_CONTACT_GROUP_H
#include "server/sim/contact/contact_points.h"

typedef struct pal_contact_group {
    double normal[3]; /* from tissue to tool, unit                                         */
    double force_N;   /* without friction, 0 when only near                                  */
    double gap_m;     /* distance the tool has to go until it touches, >= 0; 0 in contact  */
    double k_N_m;     /* tangent stiffness by the compliance; 0: not known                 */
    double sideways;  /* stiffness across over that along the normal; 0: not known         */
} pal_contact_group;

/* two unit directions across a unit direction */
void pal_contact_group_across(const double n[3], double t[2][3]);
/* true when a direction from the tool belongs to a group about `axis`, both unit */
bool pal_contact_group_has(const double axis[3], const double direction[3]);
/* the strongest contacts not yet grouped [n]; they are grouped then. False: there are none */
bool pal_contact_group_next(const pal_contact *contact, int n, uint8_t *grouped, pal_contact_group *group);
/* the nearest tissue, of points x [n_point][3] within radius + near of a sphere's centre, not in the direction of an
 * earlier group, or beside a contact only opposite it; directions within NEAREST_RADII are averaged. False: none */
bool pal_contact_group_near(const double centre[3], double radius_m, double near_m, const double *x, int n_point,
                            const pal_contact_group *earlier, int n_earlier, pal_contact_group *group);
#endif
