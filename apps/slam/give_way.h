#pragma once

#include <pthread.h>
#include <sched.h>

namespace hybrid_slam {

// For threads that others wake and go on beside: the calling thread does not displace what runs
// when it wakes up (Linux' SCHED_BATCH), but begins when a processor is free or its turn comes.
// Else who pushes an image would stand still while what he woke works on it. Its share of the
// processor is as before. Nothing changes where the system does not know this, or the program was
// started under another policy.
inline void give_way() {
#ifdef SCHED_BATCH
  sched_param priority{};
  int policy = 0;
  if (pthread_getschedparam(pthread_self(), &policy, &priority) != 0 || policy != SCHED_OTHER)
    return;
  pthread_setschedparam(pthread_self(), SCHED_BATCH, &priority);
#endif
}

}  // namespace hybrid_slam
