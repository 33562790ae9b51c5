// Runs SoftWorldBehaviour and SoftBodyBehaviour on the stubs in Unity's order: BehaviourChecks FOLDER [levels]. The
// folder contains a world with axes for Unity; with `levels`, it is the scene `levels` of tests/native/scenes.py. This
// program does not test Unity.
using System;
using System.IO;
using System.Reflection;
using UnityEngine;

namespace TaichiSoft
{
    internal static class BehaviourChecks
    {
        private const float Step = 1f / 50;
        private static Action lateUpdates = () => { }, destroy = () => { }; // calls for the components in CheckLevels

        private static void Require(bool isTrue, string text)
        {
            if (!isTrue) throw new Exception(text);
        }

        private static Action Message(object component, string name)
        {
            MethodInfo method = component.GetType().GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic);
            return (Action)Delegate.CreateDelegate(typeof(Action), component, method);
        }

        // Sets a serialized field, as Unity's inspector does.
        private static void Set(object component, string name, object value)
        {
            FieldInfo field = component.GetType().GetField(name, BindingFlags.Instance | BindingFlags.NonPublic);
            Require(Attribute.IsDefined(field, typeof(SerializeField)), name + " is not in the inspector");
            field.SetValue(component, value);
        }

        private static double Dot(Vector3 a, Vector3 b)
        {
            return (double)a.x * b.x + (double)a.y * b.y + (double)a.z * b.z;
        }

        private static Vector3 Cross(Vector3 a, Vector3 b)
        {
            return new Vector3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
        }

        private static int Main(string[] arguments)
        {
            Application.streamingAssetsPath = Path.GetDirectoryName(arguments[0]);
            Time.fixedDeltaTime = Step;
            if (arguments.Length > 1)
            {
                CheckLevels(arguments[0]);
            }
            else
            {
                CheckFrames(arguments[0]);
            }
            return 0;
        }

        // Checks that bodies without a skin are drawn with the mesh of their level of detail.
        private static void CheckLevels(string folder)
        {
            var world = new SoftWorldBehaviour();
            Set(world, "folder", Path.GetFileName(folder));
            Message(world, "Awake")();
            MeshFilter bar = Drawn(world, "body3", ""), named = Drawn(world, "body4", "asset1.surface1");
            MeshFilter ball = Drawn(world, "body0", "");
            Mesh skin = ball.sharedMesh;
            Action fixedUpdate = Message(world, "FixedUpdate"), update = Message(world, "Update");
            Action frame = () =>
            {
                Time.fixedTime += Step;
                Time.time = Time.fixedTime;
                fixedUpdate();
                update();
                lateUpdates();
            };

            Body body = world.World.GetBody(3), other = world.World.GetBody(4), round = world.World.GetBody(0);
            int[] levels = { 0, 2, 1, 1, 0, 2, 0, 1 };
            foreach (int level in levels)
            {
                body.SetLevel(level);
                other.SetLevel(2 - level);
                round.SetLevel(level);
                frame();
                RequireLevel(world.Scene, bar.sharedMesh, body, level);
                RequireLevel(world.Scene, named.sharedMesh, other, 2 - level);
                Require(ball.sharedMesh == skin, "a skin is another mesh at another level");
                Console.WriteLine("level {0}: {1}", level, bar.sharedMesh.triangles.Length / 3);
            }
            long before = GC.GetAllocatedBytesForCurrentThread();
            for (int i = 0; i < 60; ++i)
            {
                body.SetLevel(i % 3);
                frame();
            }
            Console.WriteLine("allocated: {0}", GC.GetAllocatedBytesForCurrentThread() - before);

            byte[] kept = world.World.Snapshot();
            body.SetLevel(0);
            frame();
            RequireLevel(world.Scene, bar.sharedMesh, body, 0);
            world.World.Restore(kept);
            frame();
            RequireLevel(world.Scene, bar.sharedMesh, body, 2);
            body.Despawn();
            frame();
            foreach (Vector3 vertex in bar.sharedMesh.vertices) Require(Dot(vertex, vertex) == 0, "nobody is drawn");
            world.World.Spawn(1, new Placement(new Vector3d(4, 3, 3), Quaterniond.Identity)); // far from other bodies
            frame();
            RequireLevel(world.Scene, bar.sharedMesh, world.World.GetBody(3), 0);
            destroy();
            Message(world, "OnDestroy")();
            lateUpdates();
        }

        // Makes a component that draws a body. Returns: its MeshFilter.
        private static MeshFilter Drawn(SoftWorldBehaviour world, string body, string mesh)
        {
            var filter = new MeshFilter();
            var component = new SoftBodyBehaviour { transform = new Transform(), other = filter };
            Set(component, "world", world);
            Set(component, "body", body);
            Set(component, "mesh", mesh);
            Message(component, "Start")();
            lateUpdates += Message(component, "LateUpdate");
            destroy += Message(component, "OnDestroy");
            return filter;
        }

        private static void RequireLevel(Scene scene, Mesh drawn, Body body, int level)
        {
            Require(body.Level == level, "the body is at another level");
            int number = scene.Find(NameKind.Mesh, "asset1.surface" + (level == 0 ? "" : level.ToString()));
            MeshInfo info = scene.GetMeshInfo(number);
            float[] positions = new float[3 * info.VertexCount], normals = new float[3 * info.VertexCount];
            body.ReadMesh(number, positions, normals);
            var triangles = new int[3 * info.TriangleCount];
            scene.GetTriangles(number, triangles);
            Require(drawn.vertices.Length == info.VertexCount, "the mesh has the vertices of another level");
            Require(drawn.normals.Length == info.VertexCount, "the mesh has the normals of another level");
            Require(drawn.triangles.Length == triangles.Length, "the mesh has the triangles of another level");
            for (int i = 0; i < triangles.Length; ++i) Require(drawn.triangles[i] == triangles[i], "another triangle");
            for (int i = 0; i < info.VertexCount; ++i)
            {
                Vector3 place = drawn.vertices[i], normal = drawn.normals[i];
                Require(IsAt(place, positions, 3 * i), "the mesh is elsewhere");
                Require(IsAt(normal, normals, 3 * i), "a normal is another one");
            }
        }

        private static bool IsAt(Vector3 vector, float[] numbers, int begin)
        {
            return vector.x == numbers[begin] && vector.y == numbers[begin + 1] && vector.z == numbers[begin + 2];
        }

        private static void CheckFrames(string folder)
        {
            var lift = new Transform { rotation = Quaternion.identity };
            var world = new SoftWorldBehaviour();
            Set(world, "folder", Path.GetFileName(folder));
            Set(
                world, "colliders",
                new[] { new SoftWorldBehaviour.Follower { name = "collider0", target = lift } });
            var filter = new MeshFilter();
            var body = new SoftBodyBehaviour { transform = new Transform(), other = filter };
            Set(body, "world", world);
            Set(body, "body", "body1");
            Message(world, "Awake")();
            Message(body, "Start")();
            Mesh drawn = filter.sharedMesh;

            Action fixedUpdate = Message(world, "FixedUpdate"), update = Message(world, "Update");
            Action lateUpdate = Message(body, "LateUpdate");
            var times = new Random(1);
            double time = 0;
            int steps = 0;
            var told = new int[(int)EventKinds.All];
            bool isFirst = true;
            Action<SoftEvent> count = happened =>
            {
                Require(happened.Step < steps && happened.Body.World == world.World, "an event of elsewhere");
                ++told[(int)happened.Kind];
            };
            world.ContactBegan += count;
            world.ContactEnded += count;
            world.FellAsleep += count;
            world.Woke += count;
            world.ContactBegan += happened =>
            {
                bool throws = isFirst;
                isFirst = false;
                if (throws) throw new InvalidOperationException();
            };
            Action frame = () =>
            {
                time += 0.002 + 0.03 * times.NextDouble(); // shorter or longer than a step
                while ((steps + 1) * (double)Step <= time)
                {
                    ++steps;
                    Time.fixedTime = steps * Step;
                    lift.position = new Vector3(0, 0.2f + 0.1f * (float)Math.Sin(0.05 * steps), 0);
                    fixedUpdate();
                }
                Time.time = (float)time;
                update();
                lateUpdate();
            };

            int thrown = 0;
            for (int i = 0; i < 100; ++i)
            {
                try
                {
                    frame();
                }
                catch (InvalidOperationException)
                {
                    ++thrown; // Unity also continues with the next frame
                }
            }
            Require(thrown == 1, "what a listener throws is lost");
            long before = GC.GetAllocatedBytesForCurrentThread();
            for (int i = 0; i < 1000; ++i)
            {
                frame();
                Require(world.Clock.Steps == steps, "a FixedUpdate is not one step");
                double part = Math.Max(0, Math.Min((double)Time.time - Time.fixedTime, 0.999 * Step)) / Step;
                Require(Math.Abs(world.Clock.Alpha - part) < 1e-6, "alpha is not where the frame is");
            }
            Console.WriteLine("allocated: {0}", GC.GetAllocatedBytesForCurrentThread() - before);

            // Make the same steps without components.
            var scene = new Scene(folder);
            var plain = new World(scene);
            int asset = plain.GetBody(1).GetAsset();
            var expected = new float[3 * drawn.vertices.Length];
            var events = new SoftEvent[3]; // some steps have more events
            var happenedThere = new int[told.Length];
            plain.RecordEvents(EventKinds.All & ~EventKinds.Froze);
            for (int i = 1; i <= steps; ++i)
            {
                double height = 0.2f + 0.1f * (float)Math.Sin(0.05 * i);
                plain.MoveCollider(0, new Pose(new Vector3d(0, height, 0), Quaterniond.Identity));
                plain.Step(Step);
                for (int made = plain.DrainEvents(events); made > 0; made = plain.DrainEvents(events))
                {
                    for (int k = 0; k < made; ++k) ++happenedThere[(int)events[k].Kind];
                }
            }
            for (int kind = 0; kind < told.Length; ++kind)
            {
                Require(told[kind] == happenedThere[kind], "events are not those of the world");
            }
            Require(plain.Hash() == world.World.Hash(), "the world went another way");
            plain.SetFixedStep(Step);
            plain.Advance(world.Clock.Alpha * Step);
            plain.GetBody(1).ReadMesh(0, expected, null);
            double apart = 0, lowest = 1;
            for (int i = 0; i < drawn.vertices.Length; ++i)
            {
                Vector3 there = new Vector3(expected[3 * i], expected[3 * i + 1], expected[3 * i + 2]);
                Vector3 difference = drawn.vertices[i] - there;
                apart = Math.Max(apart, Math.Sqrt(Dot(difference, difference)));
                lowest = Math.Min(lowest, there.y);
            }
            Require(apart < 1e-5, "the mesh is elsewhere");
            Require(lowest > -0.05, "y does not point up");

            // In Unity, the vertices of a visible face are clockwise, and Cross follows the left-hand rule.
            int[] triangles = drawn.triangles;
            for (int i = 0; i < triangles.Length; i += 3)
            {
                Vector3 a = drawn.vertices[triangles[i]], b = drawn.vertices[triangles[i + 1]];
                Vector3 face = Cross(b - a, drawn.vertices[triangles[i + 2]] - a);
                Require(Dot(face, drawn.normals[triangles[i]]) > 0, "a face looks inwards");
            }

            world.World.GetBody(1).Despawn();
            frame();
            Require(Dot(drawn.vertices[5], drawn.vertices[5]) == 0, "nobody is drawn");
            frame();
            world.World.Spawn(asset, new Placement(new Vector3d(0, 2, 0), Quaterniond.Identity));
            frame();
            Require(Dot(drawn.vertices[5], drawn.vertices[5]) > 1, "who came is not drawn");
            Message(world, "OnDestroy")();
            lateUpdate(); // Unity destroys in any order
            Message(body, "OnDestroy")();
            plain.Dispose();
            scene.Dispose();
            Console.WriteLine("steps: {0}", steps);
            Console.WriteLine("contacts: {0}", told[(int)EventKinds.ContactBegan]);
        }
    }
}
