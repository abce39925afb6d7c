// SPDX-License-Identifier: GPL-3.0-or-later
#include "story.hpp"

namespace r4::simulation {
namespace {

using Kind = Act::Kind;

std::vector<Story> all() {
  std::vector<Story> all;
  Story story;

  story = Story();
  story.name = "drive";
  story.text = "a host connects, drives, stops the board, clears the stop and drives on";
  story.acts = {{0, Kind::start},   {700, Kind::command}, {1000, Kind::group},
                {1300, Kind::stop}, {1500, Kind::clear},  {1900, Kind::command}};
  story.faults_until_ms = 2100;
  story.ends_ms = 5000;
  all.push_back(story);

  story = Story();
  story.name = "killed";
  story.text = "a host drives and is killed";
  story.acts = {{0, Kind::start}, {700, Kind::command}, {1300, Kind::kill}};
  story.faults_until_ms = 1800;
  story.ends_ms = 4500;
  all.push_back(story);

  story = Story();
  story.name = "restart";
  story.text = "a host drives, is killed and restarts at once, and drives";
  story.acts = {{0, Kind::start},
                {700, Kind::command},
                {1100, Kind::kill},
                {1150, Kind::start},
                {2600, Kind::command}};
  story.faults_until_ms = 2700;
  story.ends_ms = 5500;
  all.push_back(story);

  story = Story();
  story.name = "farewell";
  story.text = "a host drives and says farewell; a second host takes control and drives";
  story.hosts = 2;
  story.acts = {{0, Kind::start},
                {700, Kind::command},
                {1000, Kind::leave},
                {1200, Kind::start, 1},
                {1900, Kind::command, 1}};
  story.faults_until_ms = 2000;
  story.ends_ms = 5000;
  all.push_back(story);

  story = Story();
  story.name = "waiting";
  story.text = "a host drives while a second one waits; the first is killed, the second drives";
  story.hosts = 2;
  story.acts = {{0, Kind::start},
                {500, Kind::start, 1},
                {700, Kind::command},
                {1000, Kind::kill},
                {2600, Kind::command, 1}};
  story.faults_until_ms = 2600;
  story.ends_ms = 5500;
  all.push_back(story);

  story = Story();
  story.name = "watched";
  story.text = "a host drives while a program watches, and is killed";
  story.watched = true;
  story.acts = {{0, Kind::start}, {200, Kind::start, 2}, {700, Kind::command}, {1200, Kind::kill}};
  story.faults_until_ms = 1700;
  story.ends_ms = 4000;
  all.push_back(story);

  story = Story();
  story.name = "two paths";
  story.text = "a host drives over two paths, of which one carries nothing for a while";
  story.paths = 2;
  story.acts = {{0, Kind::start}, {900, Kind::command}, {1200, Kind::cut, 0}, {1500, Kind::group}};
  story.faults_until_ms = 1700;
  story.ends_ms = 5000;
  all.push_back(story);

  story = Story();
  story.name = "cable";
  story.text =
      "a host drives over the board's cable alone, and is killed; strangers are on its network";
  story.paths = 2;
  story.paths_of_first = 1;
  story.acts = {{0, Kind::start}, {700, Kind::command}, {1200, Kind::kill}};
  story.faults_until_ms = 1700;
  story.ends_ms = 4000;
  all.push_back(story);

  story = Story();
  story.name = "reboot";
  story.text = "a host drives, the board restarts, the host drives on";
  story.acts = {
      {0, Kind::start}, {700, Kind::command}, {1000, Kind::reboot}, {1700, Kind::command}};
  story.faults_until_ms = 1900;
  story.ends_ms = 4800;
  all.push_back(story);

  story = Story();
  story.name = "sleep";
  story.text = "a host drives, its computer sleeps, it drives on";
  story.acts = {{0, Kind::start}, {700, Kind::command}, {1000, Kind::sleep}, {3200, Kind::command}};
  story.faults_until_ms = 3300;
  story.ends_ms = 6000;
  all.push_back(story);

  story = Story();
  story.name = "key";
  story.text = "a host with a key drives and is killed";
  story.keys = true;
  story.acts = {{0, Kind::start}, {700, Kind::command}, {1300, Kind::kill}};
  story.faults_until_ms = 1800;
  story.ends_ms = 4500;
  all.push_back(story);

  story = Story();
  story.name = "bridge";
  story.text = "a host drives over a bridge, and is killed";
  story.bridge = true;
  story.acts = {{0, Kind::start}, {700, Kind::command}, {1200, Kind::kill}};
  story.faults_until_ms = 1700;
  story.ends_ms = 4500;
  all.push_back(story);

  story = Story();
  story.name = "bridge for two";
  story.text =
      "a host drives over a bridge while a second one waits; it is killed, the second drives";
  story.bridge = true;
  story.hosts = 2;
  story.acts = {{0, Kind::start},
                {500, Kind::start, 1},
                {700, Kind::command},
                {1000, Kind::kill},
                {2600, Kind::command, 1}};
  story.faults_until_ms = 2600;
  story.ends_ms = 6000;
  all.push_back(story);

  return all;
}

}  // namespace

const std::vector<Story>& stories() {
  static const std::vector<Story> list = all();
  return list;
}

}  // namespace r4::simulation
