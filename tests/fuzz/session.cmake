pal_fuzz(replay_log LINK pal_session)
