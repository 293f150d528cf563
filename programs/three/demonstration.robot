# The demonstration of the three-processor controller: every profile, a square with via points, every kind of jog, signals,
# and what can go wrong. docs/robot-commands.md

let home = joints(0, 90, 0, 0, -45, 0)

sub expect(name, wanted)
  if cause() != wanted
    say "not what was expected: cause ", cause(), " in place of ", wanted, " in part ", name
  end
end

# ---- Each profile: there in a given time, back at a given speed ---------------------------------------------------------------
say "profiles"
let there = joints(25, 70, 20, 15, -60, 30)
move there in 0.8 profile rectangular
move home at 60 profile rectangular
move there in 0.8 profile trapezoidal
move home at 60 profile trapezoidal
move there in 0.8 profile parabolic
move home at 60 profile parabolic
move there in 0.8 profile cosine
move home at 60 profile cosine
move there fast
move home fast

# ---- A square on a table that leans, its corners via points: no stop between its sides -----------------------------------------
say "square"
let table = frame(440, 0, 600, 0, 20, 0)
let flat = inverse(table) * pose(440, 0, 600, 180, -45, 0)
sub corner(x, y)
  via movel table * frame(x, y, 0, 0, 0, 0) * flat at 200 profile cosine
end
movel table * flat at 150
signal 1 on
repeat 2
  call corner(60, 60)
  call corner(-60, 60)
  call corner(-60, -60)
  call corner(60, -60)
end
movel table * flat at 150
signal 1 off
level 1, 2.5

# ---- Jogs ----------------------------------------------------------------------------------------------------------------------
say "jogs"
wait done                                            # signals and levels too
jog joints 20, 0, 0, -30, 0, 40 for 0.6
jog world 0, 0, 60, 0, 0, 0 for 0.6
jog gripper 0, 0, 60, 0, 0, 20 for 0.6
move home fast

# ---- A signal that is waited for, with the robot on its way ---------------------------------------------------------------------
say "signals"
simulate input 3 on after 0.3
start move joints(30, _, _, _, _, _) in 1.5
wait input 3 on for 2
say "input 3 came while q1 was ", floor(joints().q1)
stop
say "stopped at ", floor(joints().q1)
move home fast

# ---- What is refused: the robot stands -----------------------------------------------------------------------------------------
say "refusals"
try
  movel pose(1500, _, _, _, _, _)
else
  call expect(1, 8)
end
try
  move joints(_, 175, _, _, _, _)
else
  call expect(2, 7)
end
try
  move joints(90, _, _, _, _, _) in 0.6 profile rectangular
else
  call expect(3, 10)
end
limits torque 40, 60, 40, 4, 4, 2
try
  move joints(25, 70, 20, 15, -60, 30) in 0.6
else
  call expect(4, 11)
end
check move joints(25, 70, 20, 15, -60, 30) fast
move joints(25, 70, 20, 15, -60, 30) fast            # slower, with what the lower limits leave
limits torque 1000, 1000, 1000, 1000, 1000, 1000
check move home fast
move home fast

# ---- What stops the robot -----------------------------------------------------------------------------------------------------
say "a buffer runs dry"
try
  via move joints(20, _, _, _, _, _) in 0.5
  wait 1
else
  call expect(5, 15)
  reset
end
say "faults of the link"
try
  simulate corrupt after 0.2
  start move joints(40, _, _, _, _, _) in 2
  wait 0.5
  signal 2 on
  wait done
else
  call expect(6, 1)
  reset
end
move home fast
try
  simulate order after 0.2
  start move joints(40, _, _, _, _, _) in 2
  wait 0.5
  signal 2 on
  wait done
else
  call expect(7, 2)
  reset
end
move home fast
try
  simulate late after 0.2
  start move joints(40, _, _, _, _, _) in 2
  wait 0.5
  signal 2 on
  wait done
else
  call expect(8, 4)
  reset
end
move home fast
try
  simulate silent after 0.1
  start move joints(40, _, _, _, _, _) in 2
  wait 0.5
  signal 2 on
  wait done
else
  call expect(9, 5)
  reset
end
move home fast
wait 0.3                                             # the servo comes to rest
say "end"
