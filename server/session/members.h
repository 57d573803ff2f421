/* Members of a session: who is there, in what role, and who holds which tool. A plain table without threads: the hub
 * owns it. A tool has one holder, hence one writer. Thread: [net]. */
#ifndef PAL_SESSION_MEMBERS_H
#define PAL_SESSION_MEMBERS_H
#include "server/sim/tools.h"

enum { PAL_MEMBER_MAX = 256, PAL_MEMBER_NAME = 32 };

typedef enum pal_role { PAL_ROLE_VIEWER, PAL_ROLE_TRAINEE, PAL_ROLE_INSTRUCTOR } pal_role;

typedef struct pal_member {
    int id; /* > 0, never used twice; 0: free place */
    pal_role role;
    char name[PAL_MEMBER_NAME]; /* UTF-8, control characters removed; made unique by a number */
    int tool;                   /* held, -1: none */
} pal_member;

typedef struct pal_members {
    int n_tool, next_id, n_member;
    int holder[PAL_TOOL_MAX]; /* member id, 0: free */
    pal_member member[PAL_MEMBER_MAX];
} pal_members;

void pal_members_init(pal_members *members, int n_tool);
/* FULL when no place is left */
pal_err pal_members_join(pal_members *members, pal_role role, const char *name, int *id);
void pal_members_leave(pal_members *members, int id); /* its tool becomes free */
pal_member *pal_members_find(pal_members *members, int id);
/* tool -1: any free one. STATE: held by somebody else or none free; REFUSED: a viewer, or no such tool. Taking another
 * tool gives back the one held. */
pal_err pal_members_take(pal_members *members, int id, int tool, int *taken);
void pal_members_give_back(pal_members *members, int id);
bool pal_members_may_command(const pal_members *members, int id); /* trainees and instructors; viewers not */
#endif
