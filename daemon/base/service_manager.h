// What systemd wants to know of a service (sd_notify(3)), without its library.
#pragma once

#include <string>

namespace patina::daemon {

// Sends e.g. "READY=1" or "STOPPING=1" to the socket that $NOTIFY_SOCKET names. Nothing happens
// where there is none; a message that cannot be sent is dropped.
void NotifyServiceManager(const std::string& message);

}  // namespace patina::daemon
