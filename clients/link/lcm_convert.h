/* Conversion between palpate.v2 structs and the LCM messages of lcmtypes. Input has passed the length check of
 * lcm_walk.h; invalid values (version, tool, counts, ranges) are refused here. Thread: any. */
#ifndef PAL_LINK_LCM_CONVERT_H
#define PAL_LINK_LCM_CONVERT_H
#include "palpate_haptic_model_t.h"
#include "palpate_tool_state_t.h"
#include "protocol/wire.h"
#include "server/base/err.h"

#include <stddef.h>

/* encoded tool_state_t (lcmtypes/) to a pose; REFUSED: version, tool, position or quaternion out of range */
pal_err pal_lcm_to_pose(const void *bytes, size_t n_byte, pal_wire_pose *out);
void pal_lcm_from_pose(const pal_wire_pose *pose, palpate_tool_state_t *out);
/* encoded haptic_model_t (lcmtypes/) to HAPTIC; REFUSED: version, tool, number of patches, flags */
pal_err pal_lcm_to_haptic(const void *bytes, size_t n_byte, pal_wire_haptic *out);
/* writes the patches to patch [PAL_WIRE_CONTACT_PATCH_MAX], which out borrows */
void pal_lcm_from_haptic(const pal_wire_haptic *haptic, palpate_haptic_model_t *out, palpate_contact_patch_t *patch);
#endif
