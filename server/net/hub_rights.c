#include "server/net/hub_rights.h"

#include <stdio.h>
#include <string.h>

#define LET(right) "instructors, and trainees with the right " right
const char *const pal_right_text[PAL_RIGHT_COUNT] = {"everybody",
                                                     "trainees and instructors",
                                                     "instructors and holders of a tool",
                                                     LET("steer"),
                                                     LET("material"),
                                                     LET("component"),
                                                     LET("configure"),
                                                     LET("sculpt"),
                                                     LET("cut"),
                                                     "instructors"};
/* the last word of a sentence above; NULL: nobody is given it */
static const char *name_of(int right)
{
    return right < PAL_RIGHT_STEER || right > PAL_RIGHT_CUT ? NULL : strrchr(pal_right_text[right], ' ') + 1;
}

void pal_rights_text(uint32_t rights, char *text, size_t cap)
{
    text[0] = 0;
    for (int r = 0, n = 0; r < PAL_RIGHT_COUNT; r++)
        if (name_of(r) && (rights & 1u << r) && (size_t)n < cap)
            n += snprintf(text + n, cap - (size_t)n, "%s%s", n ? " " : "", name_of(r));
}

uint32_t pal_rights_named(const char *name)
{
    uint32_t rights = 0;
    for (int r = 0; r < PAL_RIGHT_COUNT; r++)
        if (name_of(r) && (!name[0] || !strcmp(name_of(r), name))) rights |= 1u << r;
    return rights;
}

bool pal_hub_may(const pal_client *c, pal_right right)
{
    const pal_member_entry *m = c->member;
    const bool trainee = m->role == PAL_MEMBER_TRAINEE;
    if (m->role == PAL_MEMBER_INSTRUCTOR || right == PAL_RIGHT_EVERYBODY) return true;
    if (right == PAL_RIGHT_TRAINEE) return trainee;
    if (right == PAL_RIGHT_TOOL) return m->tool >= 0;
    return trainee && (m->rights & 1u << right);
}

bool pal_hub_is_instructor(const pal_client *c)
{
    return c->member->role == PAL_MEMBER_INSTRUCTOR;
}

bool pal_hub_playing(const pal_hub_room *room, pal_playing *playing)
{
    pal_playing now = {.state = PAL_PLAYS_NOTHING};
    if (room->recording.recording) pal_session_playing(room->session, &now);
    if (playing) *playing = now;
    return now.state != PAL_PLAYS_NOTHING;
}
