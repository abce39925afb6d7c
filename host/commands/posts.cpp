// SPDX-License-Identifier: GPL-3.0-or-later
#include "posts.hpp"

#include <cstddef>
#include <utility>

#include "../../protocol/link/board_link.hpp"

namespace r4 {

namespace {

constexpr std::size_t remembered = BoardLink::memory;

}  // namespace

PostResult Posts::send(const Command& command, Time now) {
  return begin(outbox_.send(command, {}, now), command, false);
}

PostResult Posts::send(const Setpoints& group, Time now) {
  const Outbox::Sent sent = outbox_.send(group, now);
  if (groups_.empty()) groups_.resize(remembered);
  groups_[sent.pnum % remembered] = group;
  return begin(sent, group[0], true);
}

PostResult Posts::begin(Outbox::Sent sent, const Command& command, bool is_group) {
  if (posted_.empty()) posted_.resize(remembered);
  Posted& posted = posted_[sent.pnum % remembered];
  posted = {true, is_group, sent.pnum, command};
  posted.command.text = posted.command.text2 = Text();
  delivery_.begin(sent);
  kind_ = command.kind;
  return sent.paths != 0 ? PostResult::sent : result();
}

const Posts::Posted* Posts::take(std::uint32_t pnum) {
  if (posted_.empty()) return nullptr;
  Posted& posted = posted_[pnum % remembered];
  return posted.pnum == pnum && std::exchange(posted.open, false) ? &posted : nullptr;
}

PostResult Posts::result() {
  if (delivery_.result() == SendResult::sent) {
    ++counts_.commands;
    return {PostResult::sent, delivery_.pnum()};
  }
  take(delivery_.pnum());
  return delivery_.result() == SendResult::full ? PostResult::queue_full : PostResult::no_link;
}

void Posts::on_refusal(const Nack& nack) {
  const Posted* const posted = take(nack.pnum);
  if (posted == nullptr || nack.code == Refusal::duplicate) return;
  ++counts_.refused;
  RefusedPost refused{posted->command, nack.code, PostResult::sent};
  if (posted->is_group) {
    const Setpoints& group = groups_[nack.pnum % remembered];
    refused.group = static_cast<std::uint8_t>(group.size());
    if (nack.at <= group.size()) refused.at = nack.at;
    if (refused.at != 0) refused.command = group[refused.at - 1U];
  }
  effects_.report(refused);
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
    case PostResult::late:
      return "late";
  }
  return "unknown";
}

}  // namespace r4
