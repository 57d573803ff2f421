/* Members of a session: who is there, in what role, and who holds which tool. A plain table without threads: the hub
 * owns it. A tool has one holder, hence one writer. (Type names differ from protocol/control.h's, which net sees too.)
 * Thread: [net]. */
#ifndef PAL_SESSION_MEMBERS_H
#define PAL_SESSION_MEMBERS_H
#include "server/sim/core/tools.h"

enum { PAL_MEMBER_LIST_MAX = 64, PAL_MEMBER_NAME = 48 };

typedef enum pal_member_role { PAL_MEMBER_VIEWER, PAL_MEMBER_TRAINEE, PAL_MEMBER_INSTRUCTOR } pal_member_role;

typedef struct pal_member_entry {
    int id; /* > 0, never used twice; 0: free place */
    pal_member_role role;
    char name[PAL_MEMBER_NAME]; /* UTF-8, control characters removed; made unique by a number */
    int tool;                   /* held, -1: none */
} pal_member_entry;

typedef struct pal_member_list {
    int n_tool, next_id, n_member;
    int holder[PAL_TOOL_MAX]; /* member id, 0: free */
    pal_member_entry member[PAL_MEMBER_LIST_MAX];
} pal_member_list;

void pal_members_init(pal_member_list *members, int n_tool);
/* FULL when no place is left */
pal_err pal_members_join(pal_member_list *members, pal_member_role role, const char *name, int *id);
void pal_members_leave(pal_member_list *members, int id); /* its tool becomes free */
pal_member_entry *pal_members_find(pal_member_list *members, int id);
/* tool -1: any free one. STATE: held by somebody else or none free; REFUSED: a viewer, or no such tool. Taking another
 * tool gives back the one held. */
pal_err pal_members_take_tool(pal_member_list *members, int id, int tool, int *taken);
void pal_members_release_tool(pal_member_list *members, int id);
bool pal_members_may_command(const pal_member_list *members, int id); /* trainees and instructors; viewers not */
#endif
