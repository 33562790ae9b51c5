// Plays a recorded game on a world file: Play FOLDER < GAME. The output equals that of ../tests/play.c.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;

namespace TaichiSoft
{
    internal static class Play
    {
        private static Scene scene;
        private static World world;
        private static string[] words;
        private static int at;
        private static byte[] kept;
        private static Body[] bodies;
        private static readonly SoftEvent[] events = new SoftEvent[10000]; // more events cannot wait
        private static TextWriter output;

        private static double Number()
        {
            return double.Parse(words[at++], NumberStyles.Float, CultureInfo.InvariantCulture);
        }

        private static int Whole()
        {
            return (int)Number();
        }

        private static Vector3d Vector()
        {
            double x = Number(), y = Number(), z = Number();
            return new Vector3d(x, y, z);
        }

        private static Quaterniond Turn()
        {
            double x = Number(), y = Number(), z = Number(), w = Number();
            return new Quaterniond(x, y, z, w);
        }

        private static Pose Place()
        {
            Vector3d position = Vector();
            return new Pose(position, Turn());
        }

        private static int[] List()
        {
            var found = new int[Whole()];
            for (int i = 0; i < found.Length; ++i) found[i] = Whole();
            return found.Length == 0 ? null : found;
        }

        private static Body Who()
        {
            return world.GetBody(Whole());
        }

        private static void Raycast()
        {
            Hit hit;
            Body body;
            Vector3d origin = Vector(), direction = Vector();
            SayHit(world.Raycast(origin, direction, Number(), out hit, out body), hit, body);
        }

        private static void Closest()
        {
            Hit hit;
            Body body;
            Vector3d point = Vector();
            bool isThere = world.Closest(point, Number(), out hit, out body);
            SayHit(isThere, hit, body);
            if (isThere)
            {
                Say(hit.IsInside ? "1" : "0");
            }
        }

        private static void FirstTouch()
        {
            ShapeKind kind = (ShapeKind)Whole();
            Vector3d size = Vector();
            Pose pose = Place();
            Vector3d direction = Vector();
            Cast cast = kind == ShapeKind.Plane
                ? new Cast(pose.Position, direction)
                : new Cast(kind, size, pose, direction);
            cast.MaxDistance = Number();
            cast.Targets = (Targets)Whole();
            cast.Mask = Whole();
            Touch touch;
            Body body;
            SayTouch(world.Cast(cast, out touch, out body), touch, body);
        }

        private static void Nearest()
        {
            Vector3d point = Vector();
            double reach = Number();
            Targets targets = (Targets)Whole();
            Touch touch;
            Body body;
            SayTouch(world.Nearest(point, reach, targets, Whole(), out touch, out body), touch, body);
        }

        private static void SayTouch(bool isThere, Touch touch, Body body)
        {
            if (!isThere)
            {
                Say("nothing");
                return;
            }
            bool isBody = touch.Collider < 0;
            Vector3d w = isBody ? touch.Weights : new Vector3d(0, 0, 0), x = touch.Point, n = touch.Normal;
            string row = HashOf((float)touch.Distance, (float)w.X, (float)w.Y, (float)w.Z, (float)x.X, (float)x.Y,
                (float)x.Z, (float)n.X, (float)n.Y, (float)n.Z);
            Say(string.Format(CultureInfo.InvariantCulture, "{0} {1} {2} {3} {4} {5:x8} {6}", SlotOf(body),
                touch.Collider, isBody ? touch.Vertex0 : -1, touch.Triangle, touch.IsInside ? 1 : 0,
                (uint)(touch.Depth * 1e6), row));
        }

        private static void SayHit(bool isThere, Hit hit, Body body)
        {
            if (!isThere)
            {
                Say("nothing");
                return;
            }
            Vector3d w = hit.Weights, x = hit.Point, n = hit.Normal;
            string row = HashOf((float)hit.Distance, (float)w.X, (float)w.Y, (float)w.Z, (float)x.X, (float)x.Y,
                (float)x.Z, (float)n.X, (float)n.Y, (float)n.Z);
            Say(string.Format(CultureInfo.InvariantCulture, "{0} {1} {2} {3} {4}", SlotOf(body), hit.Vertex0,
                hit.Vertex1, hit.Vertex2, row));
        }

        private static long SlotOf(Body body)
        {
            return (long)(body.Id & 0xFFFFFFFF) - 1;
        }

        private static void Drain()
        {
            int count = world.DrainEvents(events);
            Say("events " + count.ToString(CultureInfo.InvariantCulture));
            for (int i = 0; i < count; ++i)
            {
                SoftEvent e = events[i];
                string row = HashOf((float)e.Time, (float)e.Impulse.X, (float)e.Impulse.Y, (float)e.Impulse.Z,
                    (float)e.Duration);
                Say(string.Format(CultureInfo.InvariantCulture, "{0} {1} {2} {3} {4} {5}", (int)e.Kind, e.Collider,
                    e.Step, SlotOf(e.Body), SlotOf(e.Other), row));
            }
        }

        private static void SayBodies(int count)
        {
            var slots = new string[count];
            for (int i = 0; i < count; ++i) slots[i] = SlotOf(bodies[i]).ToString(CultureInfo.InvariantCulture);
            Say(count == 0 ? "nothing" : string.Join(" ", slots));
        }

        private static void Load()
        {
            Vector3d f, torque;
            Body who = Who();
            who.GetLoad(Whole(), out f, out torque);
            Say(HashOf((float)f.X, (float)f.Y, (float)f.Z, (float)torque.X, (float)torque.Y, (float)torque.Z));
        }

        private static void Hold()
        {
            Body who = Who();
            int triangle = Whole();
            Vector3d weights = Vector();
            who.Grab(new Pull(triangle, weights, Vector()) { Frequency = Number(), MaxForce = Number() });
        }

        private static Grab Held()
        {
            return world.GetGrab(Whole());
        }

        private static void Join()
        {
            Body who = Who();
            int[] list = List();
            Body other = Who();
            Say(NumberOf(who.Join(list, other, List()).Id));
        }

        private static void Connect()
        {
            Body who = Who(), other = Who();
            var kind = (JointKind)Whole();
            Vector3d anchor = Vector(), axis = Vector();
            Say(NumberOf(who.Connect(other, kind, anchor, axis).Id));
        }

        private static void AddMotor()
        {
            Body who = Who();
            int[] list = List();
            bool turns = Whole() != 0, isFixed = Whole() != 0, hasPoint = Whole() != 0;
            Vector3d axis = Vector(), point = Vector();
            double speed = Number(), limit = Number();
            Drive drive = turns ? Drive.Turn(axis, speed, limit) : Drive.Push(axis, speed, limit);
            Say(NumberOf(who.AddMotor(list, hasPoint ? drive.Through(point) : isFixed ? drive.Fixed() : drive).Id));
        }

        private static Motor Driven()
        {
            return world.GetMotor(Whole());
        }

        private static void MotorState()
        {
            Motor motor = Driven();
            Say(HashOf((float)motor.GetSpeed(), (float)motor.GetEffort()));
        }

        private static string NumberOf(ulong id)
        {
            return ((long)(id & 0xFFFFFFFF) - 1).ToString(CultureInfo.InvariantCulture);
        }

        private static void SayForce(Vector3d force)
        {
            Say(HashOf((float)force.X, (float)force.Y, (float)force.Z));
        }

        private static void SayPose(Pose pose)
        {
            Vector3d p = pose.Position;
            Quaterniond r = pose.Rotation;
            Say(HashOf((float)p.X, (float)p.Y, (float)p.Z, (float)r.X, (float)r.Y, (float)r.Z, (float)r.W));
        }

        private static void AddCollider()
        {
            var shape = new Shape((ShapeKind)Whole(), Vector())
            {
                Friction = Number(), Restitution = Number(), Thickness = Number(), Group = Whole(), Mask = Whole()
            };
            Say(world.AddCollider(shape, Place()).ToString(CultureInfo.InvariantCulture));
        }

        private static void Say(string text)
        {
            output.Write(text + "\n");
        }

        private static string Hex(ulong number)
        {
            return number.ToString("x16", CultureInfo.InvariantCulture);
        }

        // FNV-1a over words of 4 bytes.
        private static string HashOf(params float[] rows)
        {
            ulong code = 14695981039346656037;
            foreach (float row in rows)
            {
                uint word = BitConverter.ToUInt32(BitConverter.GetBytes(row), 0);
                code = unchecked((code ^ word) * 1099511628211);
            }
            return Hex(code);
        }

        private static readonly Dictionary<string, Action> calls = new Dictionary<string, Action>
        {
            { "step", Step },
            { "impulse", () => { Body who = Who(); Vector3d by = Vector(); who.ApplyImpulse(by, List()); } },
            { "force", () => { Body who = Who(); Vector3d by = Vector(); who.ApplyForce(by, List()); } },
            {
                "impulse_at",
                () => { Body who = Who(); Vector3d by = Vector(), point = Vector(); who.ImpulseAt(by, point, Number()); }
            },
            {
                "radial_impulse",
                () => { Vector3d center = Vector(); double by = Number(); world.RadialImpulse(center, by, Number()); }
            },
            { "velocity", () => { Body who = Who(); Vector3d linear = Vector(); who.SetVelocity(linear, Vector()); } },
            {
                "teleport",
                () => { Body who = Who(); Pose to = Place(); who.Teleport(to.Position, to.Rotation, Whole() != 0); }
            },
            { "gravity_scale", () => { Body who = Who(); who.SetGravityScale(Number()); } },
            { "damping", () => { Body who = Who(); who.SetDamping(Number()); } },
            { "sheltered", () => { Body who = Who(); who.SetSheltered(Whole() != 0); } },
            { "pin", () => { Body who = Who(); who.Pin(List()); } },
            { "unpin", () => { Body who = Who(); who.Unpin(List()); } },
            { "targets", Targets },
            { "set_level", () => { Body who = Who(); int level = Whole(); who.SetLevel(level, Whole() != 0); } },
            {
                "level",
                () =>
                {
                    Body who = Who();
                    Say(string.Format(CultureInfo.InvariantCulture, "{0} {1}", who.Level, who.VertexCount));
                }
            },
            { "wind", () => { Vector3d wind = Vector(); double density = Number(); world.SetWind(wind, density, Number()); } },
            { "gravity", () => world.SetGravity(Vector()) },
            { "shift_origin", () => world.ShiftOrigin(Vector()) },
            { "view_origin", () => world.SetViewOrigin(Vector()) },
            { "floor_friction", () => world.SetFriction(Number()) },
            { "body_friction", () => { Body who = Who(); who.SetFriction(Number()); } },
            { "collider_friction", () => { int which = Whole(); world.SetColliderFriction(which, Number()); } },
            { "wake", () => world.Wake() },
            { "spawn", Spawn },
            { "despawn", () => Who().Despawn() },
            { "raycast", Raycast },
            { "closest", Closest },
            { "cast", FirstTouch },
            { "nearest", Nearest },
            { "add_collider", AddCollider },
            {
                "add_sensor",
                () =>
                {
                    var shape = new Shape((ShapeKind)Whole(), Vector()) { Group = Whole(), Mask = Whole() };
                    Say(world.AddSensor(shape, Place()).ToString(CultureInfo.InvariantCulture));
                }
            },
            { "bodies_inside", () => SayBodies(world.BodiesInside(Whole(), bodies)) },
            { "remove_collider", () => world.RemoveCollider(Whole()) },
            { "move_collider", () => { int which = Whole(); world.MoveCollider(which, Place()); } },
            {
                "drive_collider",
                () => { int which = Whole(); Vector3d by = Vector(); world.SetColliderVelocity(which, by, Vector()); }
            },
            { "enabled", () => { Body who = Who(); who.SetEnabled(Whole() != 0); } },
            { "body_filter", () => { Body who = Who(); int group = Whole(); who.SetFilter(group, Whole()); } },
            {
                "collider_filter",
                () => { int which = Whole(), group = Whole(); world.SetColliderFilter(which, group, Whole()); }
            },
            { "surface_velocity", () => { int which = Whole(); world.SetSurfaceVelocity(which, Vector()); } },
            { "teleport_collider", () => { int which = Whole(); world.TeleportCollider(which, Place()); } },
            { "move_frame", () => { int which = Whole(); world.MoveFrame(which, Place()); } },
            { "snapshot", () => kept = world.Snapshot() },
            { "restore", () => world.Restore(kept) },
            { "positions", Positions },
            { "mesh", Mesh },
            { "collider_impulse", ColliderImpulse },
            { "collider_pose", () => SayPose(world.GetColliderPose(Whole())) },
            { "record_events", () => world.RecordEvents((EventKinds)Whole()) },
            { "drain", Drain },
            {
                "overlap_sphere",
                () => { Vector3d center = Vector(); SayBodies(world.OverlapSphere(center, Number(), bodies)); }
            },
            { "overlap_box", () => { Pose where = Place(); SayBodies(world.OverlapBox(where, Vector(), bodies)); } },
            {
                "attach",
                () => { Body who = Who(); int[] list = List(); int to = Whole(); who.Attach(list, to, Whole() != 0); }
            },
            { "detach", () => { Body who = Who(); who.Detach(List()); } },
            { "load", Load },
            { "grab", Hold },
            { "move_grab", () => { Grab held = Held(); held.Move(Vector()); } },
            { "release_grab", () => Held().Release() },
            { "grab_force", () => SayForce(Held().GetForce()) },
            { "join", Join },
            { "connect", Connect },
            { "joint_force", () => SayForce(world.GetJoint(Whole()).GetForce()) },
            {
                "break_attachment",
                () => { Body who = Who(); int frame = Whole(); who.SetBreakForce(frame, Number()); }
            },
            { "break_force", () => { Joint joint = world.GetJoint(Whole()); joint.SetBreakForce(Number()); } },
            { "release_joint", () => world.GetJoint(Whole()).Release() },
            { "add_motor", AddMotor },
            { "motor_speed", () => { Motor motor = Driven(); motor.SetSpeed(Number()); } },
            { "motor_limit", () => { Motor motor = Driven(); motor.SetLimit(Number()); } },
            { "motor_state", MotorState },
            { "remove_motor", () => Driven().Remove() },
            { "add_frame", () => Say(world.AddFrame(Place()).ToString(CultureInfo.InvariantCulture)) },
            { "remove_frame", () => world.RemoveFrame(Whole()) },
            { "frame_pose", () => SayPose(world.GetFramePose(Whole())) },
            { "status", () => Say(((int)Who().GetStatus()).ToString(CultureInfo.InvariantCulture)) },
            {
                "stable_substeps",
                () => Say(world.StableSubsteps(Number()).ToString(CultureInfo.InvariantCulture))
            },
        };

        private static void Step()
        {
            double dt = Number();
            world.Step(dt, Whole());
            Say(Hex(world.Hash()));
        }

        private static void Targets()
        {
            Body who = Who();
            int[] vertices = List();
            var targets = new float[3 * vertices.Length];
            for (int i = 0; i < targets.Length; ++i) targets[i] = (float)Number();
            who.SetTargets(vertices, targets);
        }

        private static void Spawn()
        {
            int asset = Whole();
            Vector3d position = Vector();
            var place = new Placement(position, Turn());
            place.Velocity = Vector();
            place.Spin = Vector();
            world.Spawn(asset, place);
        }

        private static void Positions()
        {
            Body who = Who();
            var rows = new float[3 * who.VertexCount];
            who.ReadPositions(Number(), rows);
            Say(HashOf(rows));
        }

        private static void Mesh()
        {
            Body who = Who();
            int mesh = Whole(), count = 3 * scene.GetMeshInfo(mesh).VertexCount;
            float[] rows = new float[count], normals = new float[count];
            who.ReadMesh(mesh, rows, normals);
            Say(HashOf(rows) + " " + HashOf(normals));
        }

        private static void ColliderImpulse()
        {
            Vector3d by, moment;
            world.GetColliderImpulse(Whole(), out by, out moment);
            Say(HashOf((float)by.X, (float)by.Y, (float)by.Z, (float)moment.X, (float)moment.Y, (float)moment.Z));
        }

        private static int Main(string[] arguments)
        {
            if (arguments.Length != 1)
            {
                Console.Error.WriteLine("usage: Play FOLDER < GAME");
                return 2;
            }
            output = new StreamWriter(Console.OpenStandardOutput());
            using (output)
            using (scene = new Scene(arguments[0]))
            using (world = new World(scene))
            {
                bodies = new Body[scene.GetInfo().SlotCount];
                for (string line = Console.In.ReadLine(); line != null; line = Console.In.ReadLine())
                {
                    words = line.Split(new[] { ' ' }, StringSplitOptions.RemoveEmptyEntries);
                    if (words.Length == 0) continue;
                    Action call;
                    if (!calls.TryGetValue(words[0], out call))
                    {
                        Console.Error.WriteLine("unknown call: " + line);
                        return 2;
                    }
                    at = 1;
                    try
                    {
                        call();
                    }
                    catch (SoftException exception)
                    {
                        Console.Error.WriteLine(line + ": error " + (int)exception.Code + ": " + exception.Message);
                        return 1;
                    }
                }
            }
            return 0;
        }
    }
}
