// Checks of the wrapper for tests/native/test_csharp.py: Checks FOLDER WHAT. Prints results, or throws.
using System;
using System.Diagnostics;
using System.Runtime.CompilerServices;
using System.Threading;

namespace TaichiSoft
{
    internal static class Checks
    {
        private const double Frame = 1.0 / 64;

        private static void Require(bool isTrue, string text)
        {
            if (!isTrue) throw new Exception(text);
        }

        // Makes a call, and prints the code and the text of its exception.
        private static void Refused(string what, Action call)
        {
            try
            {
                call();
            }
            catch (SoftException exception)
            {
                Console.WriteLine("{0}: {1}: {2}", what, exception.Code, exception.Message);
                return;
            }
            throw new Exception(what + " is not refused");
        }

        private static void Errors(string folder)
        {
            Refused("no folder", () => new Scene(folder + "-not-there"));
            Refused("null folder", () => new Scene(null));
            var scene = new Scene(folder);
            var world = new World(scene);
            Body ball = world.GetBody(0);
            float[] room = new float[3 * scene.GetAssetInfo(ball.GetAsset()).VertexCount], small = new float[5];
            var pose = new Pose(new Vector3d(0, 0, 1), Quaterniond.Identity);
            Refused("small buffer", () => ball.ReadPositions(1, small));
            Refused("null buffer", () => ball.ReadPositions(1, null));
            Refused("small normals", () => ball.ReadMesh(0, room, small));
            Refused("small buffer of a mesh", () => ball.ReadMesh(0, small, small));
            Refused("nan", () => world.MoveCollider(0, new Pose(new Vector3d(double.NaN, 0, 0), Quaterniond.Identity)));
            Refused("no turn", () => world.MoveCollider(0, new Pose()));
            Refused("no collider", () => world.MoveCollider(99, pose));
            Refused("negative time", () => world.Advance(-1));
            Refused("name", () => scene.Find(NameKind.Body, "nobody"));
            Refused("zero in a name", () => scene.Find(NameKind.Body, "a\0b"));
            Refused("empty list", () => ball.ApplyImpulse(new Vector3d(0, 0, 1), new int[0]));
            Refused("targets", () => ball.SetTargets(new[] { 0, 1 }, new float[3]));
            Refused("no level", () => ball.SetLevel(1));
            Require(ball.Level == 0 && scene.GetLevelCount(0) == 1 && scene.GetMeshLevel(0) == 0, "levels are others");
            Refused("not pinned", () => ball.SetTargets(new[] { 0 }, new float[3]));
            Refused("snapshot", () => world.Restore(new byte[100]));
            Refused("room for a snapshot", () => world.Snapshot(new byte[3]));
            Refused("body of no world", () => default(Body).GetAsset());
            var some = new[] { 0, 1, 2 };
            var corner = new Pull(0, new Vector3d(1, 0, 0), new Vector3d(0, 0, 1));
            Vector3d force, torque;
            Refused("kinds", () => world.RecordEvents((EventKinds)256));
            Refused("small overlap", () => world.OverlapSphere(new Vector3d(0, 0, 1), 9, new Body[1]));
            Refused("radius", () => world.OverlapSphere(new Vector3d(0, 0, 1), -1, new Body[9]));
            Refused("box", () => world.OverlapBox(pose, new Vector3d(1, double.NaN, 1), new Body[9]));
            Refused("no frame", () => ball.Attach(some, 99));
            Refused("nothing to attach", () => ball.Attach(new int[0], 0));
            Refused("no load", () => ball.GetLoad(99, out force, out torque));
            Refused("pose of no frame", () => world.GetFramePose(99));
            Refused("removed frame", () => { world.RemoveFrame(world.AddFrame(pose)); world.RemoveFrame(0); });
            Refused("weights", () => ball.Grab(new Pull(0, new Vector3d(1, 1, 1), new Vector3d(0, 0, 1))));
            Refused("no triangle", () => ball.Grab(new Pull(9999, corner.Weights, corner.Point)));
            Refused("no grab", () => world.GetGrab(16));
            Refused("grab of no world", () => default(Grab).Release());
            Grab held = ball.Grab(corner);
            Require(world.GetGrab(0).Id == held.Id && !world.GetGrab(1).IsThere, "a grab has no number");
            held.Release();
            Refused("grab that was released", () => held.Move(corner.Point));

            Body brick = world.GetBody(5), nobody = world.GetBody(4);
            Require(brick.IsAlive && !nobody.IsAlive, "a body does not live that does, or the other way");
            brick.Despawn();
            Require(!brick.IsAlive && brick.IsSomebody, "a body lives that was taken out");

            world.BeforeStep = each => { throw new InvalidOperationException("from BeforeStep"); };
            try
            {
                world.Advance(2 * Frame);
                Require(false, "what BeforeStep throws is lost");
            }
            catch (InvalidOperationException exception)
            {
                Console.WriteLine("callback: " + exception.Message);
            }
            world.BeforeStep = null;
            world.Advance(Frame); // the world still works

            world.BeforeStep = each =>
            {
                world.BeforeStep = null;
                world.Dispose();
            };
            Refused("world destroyed in a step", () => world.Advance(2 * Frame));
            Refused("world after Dispose", () => world.Step(Frame));
            Refused("body after Dispose", () => ball.GetCenter());
            world.Dispose(); // a second call does nothing
            scene.Dispose();
            scene.Dispose();
            Refused("scene after Dispose", () => new World(scene));
        }

        private static void Frames(string folder)
        {
            using (var scene = new Scene(folder))
            using (var world = new World(scene))
            {
                Body ball = world.GetBody(0);
                int count = 3 * scene.GetMeshInfo(0).VertexCount;
                float[] vertices = new float[count], normals = new float[count];
                var positions = new float[3 * scene.GetAssetInfo(ball.GetAsset()).VertexCount];
                var some = new[] { 0, 1, 2 };
                var events = new SoftEvent[200];
                var bodies = new Body[scene.GetInfo().SlotCount];
                var origin = new Vector3d(0, 0, 0.9);
                int hand = world.AddFrame(new Pose(new Vector3d(3, 0, 3), Quaterniond.Identity));
                int hit = 0, happened = 0;
                Grab held = world.GetBody(1).Grab(new Pull(0, new Vector3d(1, 0, 0), origin));
                world.GetBody(5).Attach(some, hand, feels: true);
                world.RecordEvents(EventKinds.All);
                var state = new byte[world.SnapshotSize() + 10000]; // more space, because contacts are recorded later
                int calls = 0, frame = 0;
                var none = new Vector3d();
                world.SetFixedStep(Frame);
                world.BeforeStep = each =>
                {
                    ++calls;
                    double height = 0.2 + 0.1 * Math.Sin(0.05 * frame);
                    each.MoveCollider(0, new Pose(new Vector3d(0, 0, height), Quaterniond.Identity));
                };
                Vector3d impulse, moment;
                Action one = () =>
                {
                    ++frame;
                    Clock clock = world.Advance(Frame);
                    Require(clock.StepsMade == 1, "one frame is not one step");
                    Body found = world.GetBody(0);
                    found.ReadMesh(0, vertices, normals);
                    found.ReadPositions(clock.Alpha, positions);
                    found.ApplyImpulse(new Vector3d(0, 0, 0.1), some);
                    found.GetCenter();
                    found.GetStatus();
                    world.SetColliderVelocity(1, none, none);
                    world.GetColliderPose(0);
                    world.GetColliderImpulse(0, out impulse, out moment);
                    world.Hash();
                    world.Snapshot(state);
                    happened += world.DrainEvents(events);
                    hit += world.OverlapSphere(origin, 0.5, bodies);
                    hit += world.OverlapBox(world.GetColliderPose(0), new Vector3d(2, 2, 1), bodies);
                    held.Move(new Vector3d(0.3 * Math.Sin(0.1 * frame), 0, 0.9));
                    held.GetForce();
                    world.GetBody(5).GetLoad(hand, out impulse, out moment);
                    world.MoveFrame(hand, world.GetFramePose(hand));
                };
                for (int i = 0; i < 100; ++i) one();
                long before = GC.GetAllocatedBytesForCurrentThread();
                int collections = GC.CollectionCount(0);
                for (int i = 0; i < 1000; ++i) one();
                long allocated = GC.GetAllocatedBytesForCurrentThread() - before;
                Require(happened > 20 && hit > 1000, "nothing happens");
                Require(world.DroppedEvents() == 0, "events are dropped");
                Console.WriteLine("calls of BeforeStep: {0}", calls);
                Console.WriteLine("collections: {0}", GC.CollectionCount(0) - collections);
                Console.WriteLine("allocated: {0}", allocated);
                before = GC.GetAllocatedBytesForCurrentThread();
                for (int i = 0; i < 1000; ++i) GC.KeepAlive(new object()); // proves that allocations are counted
                Console.WriteLine("allocated by 1000 objects: {0}", GC.GetAllocatedBytesForCurrentThread() - before);
            }
        }

        [MethodImpl(MethodImplOptions.NoInlining)]
        private static ulong Forgotten(Scene scene)
        {
            var world = new World(scene);
            world.BeforeStep = each => { };
            world.Advance(Frame);
            return world.Hash();
        }

        [MethodImpl(MethodImplOptions.NoInlining)]
        private static WeakReference ForgottenScene(string folder)
        {
            return new WeakReference(new Scene(folder));
        }

        // Collects garbage on a thread whose stack has no old references.
        private static void Collect()
        {
            for (int i = 0; i < 3; ++i)
            {
                GC.Collect();
                GC.WaitForPendingFinalizers();
            }
        }

        private static void Lifetimes(string folder)
        {
            using (var scene = new Scene(folder))
            {
                // Use a separate thread for each, because Mono treats old numbers on a stack as references.
                ulong first = 0;
                long before = 0;
                for (int i = 0; i < 100; ++i)
                {
                    ulong hash = 0;
                    var thread = new Thread(() => hash = Forgotten(scene));
                    thread.Start();
                    thread.Join();
                    Collect();
                    if (i == 0) first = hash;
                    if (i == 9) before = Environment.WorkingSet;
                    Require(hash == first, "worlds of one scene differ");
                }
                Console.WriteLine("grown in 90 worlds [bytes]: {0}", Environment.WorkingSet - before);
                var world = new World(scene);
                var second = new World(scene);
                second.Advance(Frame);
                Require(second.Hash() == first, "a world beside another differs");
                scene.Dispose();
                world.Advance(Frame); // the world still works without its scene
                Require(world.Hash() == first, "a world without its scene differs");
            }
            var forgetting = new Thread(() => ForgottenScene(folder));
            forgetting.Start();
            forgetting.Join();
            Collect();
            Console.WriteLine("done: yes"); // worlds that were not disposed are freed with the process
        }

        private static void Threads(string folder)
        {
            using (var scene = new Scene(folder))
            using (var world = new World(scene))
            {
                bool isOver = false;
                int refused = 0;
                var other = new Thread(() =>
                {
                    while (!Volatile.Read(ref isOver))
                    {
                        try
                        {
                            world.GetClock();
                        }
                        catch (SoftException exception)
                        {
                            if (exception.Code == ErrorCode.Busy) Interlocked.Increment(ref refused);
                        }
                    }
                });
                other.Start();
                int made = 0;
                while (made < 200)
                {
                    try
                    {
                        world.Step(Frame);
                        ++made;
                    }
                    catch (SoftException exception)
                    {
                        Require(exception.Code == ErrorCode.Busy, exception.Message);
                    }
                }
                Volatile.Write(ref isOver, true);
                other.Join();
                Require(world.GetClock().Steps == 200, "steps are lost");
                Console.WriteLine("refused: {0}", refused > 0);
            }
        }

        private static void Names(string folder)
        {
            using (var scene = new Scene(folder))
            {
                SceneInfo info = scene.GetInfo();
                int[] counts = { info.SlotCount, info.AssetCount, info.ColliderCount, info.FrameCount, info.MeshCount };
                foreach (NameKind kind in Enum.GetValues(typeof(NameKind)))
                {
                    for (int i = 0; (int)kind < counts.Length && i < counts[(int)kind]; ++i)
                    {
                        string name = scene.GetName(kind, i);
                        Require(scene.Find(kind, name) == i, name);
                        Console.WriteLine("{0} {1} {2}", kind, i, name);
                    }
                }
            }
        }

        private static int Main(string[] arguments)
        {
            switch (arguments[1])
            {
                case "errors": Errors(arguments[0]); break;
                case "frames": Frames(arguments[0]); break;
                case "lifetimes": Lifetimes(arguments[0]); break;
                case "threads": Threads(arguments[0]); break;
                case "names": Names(arguments[0]); break;
                default: return 2;
            }
            return 0;
        }
    }
}
