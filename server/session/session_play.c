/* A session that plays a recording: its records take the place of what members command. */
#include "server/session/session_core.h"

#include <string.h>

bool pal_session_play(pal_session *s)
{
    pal_playing now = s->playing; /* no other thread writes it */
    bool changed = false;
    now.step = s->play_step, now.speed = s->speed;
    now.state = s->play_at < s->n_play ? PAL_PLAYS : PAL_PLAYS_END;
    while (now.state == PAL_PLAYS && s->play_at < s->n_play) {
        pal_input_record record;
        pal_diagnostic diag = {""};
        size_t at = s->play_at;
        pal_err err = pal_input_get_record("the recording", s->play, s->n_play, &at, &record, &diag);
        if (!err && record.step > s->play_step) break;
        const bool hash = record.kind == PAL_INPUT_HASH || record.kind == PAL_INPUT_END;
        if (record.kind == PAL_INPUT_SCULPT || record.kind == PAL_INPUT_SWITCH) {
            now.state = PAL_PLAYS_CHANGE;
            break;
        }
        if (!err && hash) {
            now.n_hash++;
            now.n_hash_equal += pal_world_hash(s->world) == record.hash;
        } else if (!err && (record.kind <= PAL_INPUT_COMPONENT)) {
            err = pal_input_apply(s->world, s->scene, &record, &diag);
            if (record.kind == PAL_INPUT_POSE) s->tool[record.index].arrived_ns = session_now_ns(s);
            changed = true;
        }
        if (!err && record.kind == PAL_INPUT_MATERIAL) {
            pthread_mutex_lock(&s->lock);
            s->material[record.index] = record.material;
            pthread_mutex_unlock(&s->lock);
        }
        if (err) pal_session_put_diagnostic(s, &diag);
        s->play_at = at;
        if (err || s->play_at == s->n_play) now.state = PAL_PLAYS_END;
    }
    if (now.state == PAL_PLAYS_END) s->play_at = s->n_play;
    changed |= now.state == PAL_PLAYS_CHANGE; /* reminds who has to go past it */
    if (!memcmp(&now, &s->playing, sizeof now)) return changed;
    pthread_mutex_lock(&s->lock);
    changed |= now.state != s->playing.state;
    s->playing = now;
    pthread_mutex_unlock(&s->lock);
    return changed;
}

void pal_session_playing(pal_session *s, pal_playing *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->playing;
    pthread_mutex_unlock(&s->lock);
}
