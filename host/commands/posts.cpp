// SPDX-License-Identifier: GPL-3.0-or-later
#include "posts.hpp"

namespace r4 {

PostResult Posts::send(const Command& command, Time now) {
  const Outbox::Sent sent = outbox_.send(command, {}, now);
  posted_.add(sent.pnum, command);
  return begin(sent);
}

PostResult Posts::send(const Setpoints& group, Time now) {
  const Outbox::Sent sent = outbox_.send(group, now);
  posted_.add(sent.pnum, group);
  return begin(sent);
}

PostResult Posts::begin(Outbox::Sent sent) {
  delivery_.begin(sent);
  return sent.paths != 0 ? PostResult::sent : result();
}

PostResult Posts::result() {
  if (delivery_.result() == SendResult::sent) {
    ++counts_.commands;
    return PostResult::sent;
  }
  posted_.take(delivery_.pnum());
  return delivery_.result() == SendResult::full ? PostResult::queue_full : PostResult::no_link;
}

void Posts::on_refusal(const Nack& nack) {
  const PostedCommands::Entry* const posted = posted_.take(nack.pnum);
  if (posted == nullptr || nack.code == Refusal::duplicate) return;
  ++counts_.refused;
  RefusedPost refused{posted->command, nack.code, PostResult::sent};
  if (posted->is_group) {
    const Setpoints& group = posted_.group_of(*posted);
    refused.group = static_cast<std::uint8_t>(group.size());
    if (nack.at <= group.size()) refused.at = nack.at;
    if (refused.at != 0) refused.command = group[refused.at - 1U];
  }
  effects_.tell(PostRefused{refused});
}

const char* to_text(PostResult result) {
  switch (result.value()) {
    case PostResult::sent:
      return "sent";
    case PostResult::not_armed:
      return "not armed";
    case PostResult::no_link:
      return "no link";
    case PostResult::queue_full:
      return "queue full";
  }
  return "unknown";
}

}  // namespace r4
