// taichi-soft in C#: worlds that `taichi-soft export` wrote, stepped by the native library.
//
//     using (var scene = new Scene("game.softworld"))
//     using (var world = new World(scene))
//     {
//         Body ball = world.GetBody(scene.Find(NameKind.Body, "ball"));
//         for (;;)
//         {
//             world.Advance(secondsSinceLastFrame);
//             ball.ReadMesh(mesh, vertices, normals);
//         }
//     }
//
// Every call throws a SoftException with the library's code and text where the library refuses it. A world takes
// calls of one thread at a time. Nothing is allocated after loading, but by what returns an array or a string, and
// by exceptions. Places, turns and impulses are in the axes and the unit of length for which the world was exported.
//
// One file of C# 7 without unsafe code, for .NET, Mono and Unity. Structs are passed by value: Mono's compiler makes
// zeros of an `in` parameter that goes on to the library.
using System;
using System.Runtime.CompilerServices;
using System.Runtime.ExceptionServices;
using System.Runtime.InteropServices;
using System.Text;

namespace TaichiSoft
{
    /// <summary>Why the library refused a call.</summary>
    public enum ErrorCode
    {
        /// <summary>A value out of range, not finite, or null.</summary>
        Argument = -1,
        /// <summary>No such scene, world or body, or no more.</summary>
        Handle = -2,
        /// <summary>Another thread is in a call of this world.</summary>
        Busy = -3,
        /// <summary>A world file that is not there, not whole or damaged.</summary>
        File = -4,
        /// <summary>A world file or a library of another version.</summary>
        Version = -5,
        /// <summary>An array that does not fit.</summary>
        Size = -6,
        /// <summary>What the world cannot do now: a full pool, an attached body.</summary>
        State = -7,
        /// <summary>Bytes that are no snapshot of this world.</summary>
        Snapshot = -8,
        /// <summary>Taichi, or the system, has failed.</summary>
        Runtime = -9
    }

    /// <summary>What has a name in a scene.</summary>
    public enum NameKind
    {
        /// <summary>A slot in which a body lives.</summary>
        Body = 0,
        /// <summary>What bodies are made of.</summary>
        Asset = 1,
        /// <summary>A rigid shape that the game moves.</summary>
        Collider = 2,
        /// <summary>What attached vertices follow.</summary>
        Frame = 3,
        /// <summary>What is drawn of an asset.</summary>
        Mesh = 4,
        /// <summary>What holds two bodies together.</summary>
        Joint = 5,
        /// <summary>What drives a part of a body.</summary>
        Motor = 6
    }

    /// <summary>How a body fares.</summary>
    public enum BodyStatus
    {
        /// <summary>It moves.</summary>
        Active = 0,
        /// <summary>It failed, and stays where it last was in order.</summary>
        Frozen = 1,
        /// <summary>It lies still, and costs nothing.</summary>
        Asleep = 2
    }

    /// <summary>A refused call: the library's code and text.</summary>
    public sealed class SoftException : Exception
    {
        /// <summary>Why.</summary>
        public ErrorCode Code { get; private set; }

        /// <summary>One with a code and a text.</summary>
        public SoftException(ErrorCode code, string message) : base(message)
        {
            Code = code;
        }
    }

    /// <summary>A place [unit of length], or what has its axes: velocity [/s], impulse [kg, /s], spin [rad/s].</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector3d
    {
        /// <summary>Along the axes.</summary>
        public double X, Y, Z;

        /// <summary>From its three numbers.</summary>
        public Vector3d(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }
    }

    /// <summary>A turn, of length 1.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Quaterniond
    {
        /// <summary>Axis times sine, and cosine, of half the angle.</summary>
        public double X, Y, Z, W;

        /// <summary>From its four numbers.</summary>
        public Quaterniond(double x, double y, double z, double w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }

        /// <summary>No turn.</summary>
        public static readonly Quaterniond Identity = new Quaterniond(0, 0, 0, 1);
    }

    /// <summary>Where a collider or a frame is. UnityEngine has a Pose of its own: write TaichiSoft.Pose.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Pose
    {
        /// <summary>[unit of length]</summary>
        public Vector3d Position;
        /// <summary>Of length 1.</summary>
        public Quaterniond Rotation;

        /// <summary>From a place and a turn.</summary>
        public Pose(Vector3d position, Quaterniond rotation)
        {
            Position = position;
            Rotation = rotation;
        }
    }

    /// <summary>Where and how a body comes into the world.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Placement
    {
        internal uint structSize;
        private readonly int reserved;
        /// <summary>Of the mesh's origin [unit of length].</summary>
        public Vector3d Position;
        /// <summary>Of length 1.</summary>
        public Quaterniond Rotation;
        /// <summary>Of the centre of mass [unit of length/s].</summary>
        public Vector3d Velocity;
        /// <summary>[rad/s]</summary>
        public Vector3d Spin;

        /// <summary>At a place, turned, at rest.</summary>
        public Placement(Vector3d position, Quaterniond rotation) : this()
        {
            Position = position;
            Rotation = rotation;
        }
    }

    /// <summary>Kinds of shapes of colliders.</summary>
    public enum ShapeKind
    {
        /// <summary>Solid below a plane.</summary>
        Plane = 0,
        /// <summary>Size.X is the radius.</summary>
        Sphere = 1,
        /// <summary>Size has the edges.</summary>
        Box = 2,
        /// <summary>Along the axis that is up: Size.X is the radius, Size.Y the length between the centres.</summary>
        Capsule = 3
    }

    /// <summary>What a collider is made of, and how its surface feels.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Shape
    {
        internal uint structSize;
        /// <summary>What Size means.</summary>
        public ShapeKind Kind;
        /// <summary>[unit of length]</summary>
        public Vector3d Size;
        /// <summary>Coulomb's.</summary>
        public double Friction;
        /// <summary>0 to 1; below 0 for the bodies' own.</summary>
        public double Restitution;
        /// <summary>How far outside of the shape bodies meet it [unit of length].</summary>
        public double Thickness;
        /// <summary>Bits: two touch where each one's mask has a bit of the other's group.</summary>
        public int Group;
        /// <summary>See Group.</summary>
        public int Mask;

        /// <summary>With the surface that most things have.</summary>
        public Shape(ShapeKind kind, Vector3d size) : this()
        {
            Kind = kind;
            Size = size;
            Friction = 0.5;
            Restitution = -1.0;
            Group = 1;
            Mask = -1;
        }
    }

    /// <summary>Where a ray meets a surface first, or the point of one that is nearest.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Hit
    {
        internal uint structSize;
        /// <summary>Of the body's own surface, not of a mesh that it carries; -1 for a body without any.</summary>
        public readonly int Triangle;
        internal readonly ulong body;
        /// <summary>[unit of length]</summary>
        public readonly double Distance;
        /// <summary>Of the three vertices; their sum is 1.</summary>
        public readonly Vector3d Weights;
        /// <summary>[unit of length]</summary>
        public readonly Vector3d Point;
        /// <summary>Of length 1, outward.</summary>
        public readonly Vector3d Normal;
        /// <summary>Corners of the triangle.</summary>
        public readonly int Vertex0, Vertex1, Vertex2;
        private readonly int isInside;

        /// <summary>Of the nearest point: whether the point asked for lies in the body.</summary>
        public bool IsInside
        {
            get { return isInside != 0; }
        }
    }

    /// <summary>How a body is held: where, with what spring, and where to.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Pull
    {
        internal uint structSize;
        /// <summary>Of the body's own surface: that of a Hit.</summary>
        public int Triangle;
        /// <summary>Of its vertices; 0 or more, their sum is 1.</summary>
        public Vector3d Weights;
        /// <summary>To which it is pulled at first [unit of length].</summary>
        public Vector3d Point;
        /// <summary>Of the spring [Hz]: 5 is a hand.</summary>
        public double Frequency;
        /// <summary>Below 0 for ten times the body's weight on Earth.</summary>
        public double MaxForce;

        /// <summary>As a hand does, at a point of a triangle.</summary>
        public Pull(int triangle, Vector3d weights, Vector3d point) : this()
        {
            Triangle = triangle;
            Weights = weights;
            Point = point;
            Frequency = 5.0;
            MaxForce = -1.0;
        }

        /// <summary>As a hand does, where a ray has hit.</summary>
        public Pull(Hit hit) : this(hit.Triangle, hit.Weights, hit.Point)
        {
        }
    }

    /// <summary>What a motor does.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Drive
    {
        internal uint structSize;
        private readonly int turns;
        private int isFixed;
        private int hasPoint;
        private readonly Vector3d axis;
        private Vector3d point;
        /// <summary>Wanted [rad/s], or [unit of length/s] where it pushes.</summary>
        public double Speed;
        /// <summary>Of torque, or of force where it pushes.</summary>
        public double Limit;

        private Drive(bool turns, Vector3d axis, double speed, double limit) : this()
        {
            this.turns = turns ? 1 : 0;
            this.axis = axis;
            Speed = speed;
            Limit = limit;
        }

        /// <summary>Turn vertices about an axis through their centre, that turns with them.</summary>
        public static Drive Turn(Vector3d axis, double speed, double maxTorque)
        {
            return new Drive(true, axis, speed, maxTorque);
        }

        /// <summary>Push vertices along an axis that turns with them.</summary>
        public static Drive Push(Vector3d axis, double speed, double maxForce)
        {
            return new Drive(false, axis, speed, maxForce);
        }

        /// <summary>The same about or along an axis that stays as it is in space.</summary>
        public Drive Fixed()
        {
            Drive found = this;
            found.isFixed = 1;
            return found;
        }

        /// <summary>The same about an axis that stays in space and goes through a point.</summary>
        public Drive Through(Vector3d place)
        {
            Drive found = Fixed();
            found.hasPoint = 1;
            found.point = place;
            return found;
        }
    }

    /// <summary>What can happen; bits, to say several at once.</summary>
    [Flags]
    public enum EventKinds
    {
        /// <summary>A body touches a collider or another body.</summary>
        ContactBegan = 1,
        /// <summary>They have not touched for 0.05 s, or one of them was taken out.</summary>
        ContactEnded = 2,
        /// <summary>A body lies still from now on.</summary>
        FellAsleep = 4,
        /// <summary>It moves again.</summary>
        Woke = 8,
        /// <summary>It could not be computed any further, and stays where it was.</summary>
        Froze = 16,
        /// <summary>All of them.</summary>
        All = ContactBegan | ContactEnded | FellAsleep | Woke | Froze
    }

    /// <summary>Something that happened in a step.</summary>
    public struct SoftEvent
    {
        /// <summary>One of the kinds.</summary>
        public readonly EventKinds Kind;
        /// <summary>That the body touches; -1 where it touches a body, or nothing.</summary>
        public readonly int Collider;
        /// <summary>Of the world, counted from 0.</summary>
        public readonly long Step;
        /// <summary>At the end of that step [s].</summary>
        public readonly double Time;
        /// <summary>To whom. It may be gone by now: ask IsAlive.</summary>
        public readonly Body Body;
        /// <summary>That it touches, the one in the higher slot; IsSomebody is false where there is none.</summary>
        public readonly Body Other;
        /// <summary>That Body gave: in that step, or from the beginning of the contact to its end.</summary>
        public readonly Vector3d Impulse;
        /// <summary>Of a contact that ended [s].</summary>
        public readonly double Duration;

        internal SoftEvent(World world, ref PlainEvent plain)
        {
            Kind = plain.Kind;
            Collider = plain.Collider;
            Step = plain.Step;
            Time = plain.Time;
            Body = new Body(world, plain.Body);
            Other = new Body(world, plain.Other);
            Impulse = plain.Impulse;
            Duration = plain.Duration;
        }
    }

    // As the library writes it.
    [StructLayout(LayoutKind.Sequential)]
    internal struct PlainEvent
    {
        internal readonly EventKinds Kind;
        internal readonly int Collider;
        internal readonly long Step;
        internal readonly double Time;
        internal readonly ulong Body, Other;
        internal readonly Vector3d Impulse;
        internal readonly double Duration;
    }

    /// <summary>How much there is in a scene.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct SceneInfo
    {
        internal uint structSize;
        /// <summary>Bodies that there can be at once.</summary>
        public int SlotCount;
        /// <summary>Numbers go from 0 to these.</summary>
        public int AssetCount, ColliderCount, FrameCount, MeshCount;
    }

    /// <summary>What bodies of an asset have in common.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct AssetInfo
    {
        internal uint structSize;
        /// <summary>Of a body.</summary>
        public int VertexCount;
        /// <summary>Bodies of it that there can be at once.</summary>
        public int SlotCount;
        /// <summary>Of each [kg].</summary>
        public float Mass;
    }

    /// <summary>What is drawn of the bodies of an asset.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct MeshInfo
    {
        internal uint structSize;
        /// <summary>Its number.</summary>
        public int Asset;
        /// <summary>How much is drawn.</summary>
        public int VertexCount, TriangleCount;
        private readonly int hasUv;

        /// <summary>Whether it has texture coordinates.</summary>
        public bool HasUv
        {
            get { return hasUv != 0; }
        }
    }

    /// <summary>The time of a world.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Clock
    {
        internal uint structSize;
        /// <summary>By the last Advance.</summary>
        public int StepsMade;
        /// <summary>So far.</summary>
        public long Steps;
        /// <summary>Simulated [s].</summary>
        public double Time;
        /// <summary>How far the picture is from the previous step to the last one, 0 to 1.</summary>
        public double Alpha;
        /// <summary>Time dropped so far, where frames were too long [s].</summary>
        public double Dropped;
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct FixedStep
    {
        internal uint structSize;
        internal int substeps;
        internal int maxSteps;
        internal double dt;
    }

    /// <summary>A world file in memory, with its kernels compiled.</summary>
    // No SafeHandle: that holds a pointer, and handles of the library are numbers of 64 bits on every machine.
    // It is not needed, either: the library refuses a number that is no longer valid, and hands none out again.
    public sealed class Scene : IDisposable
    {
        private readonly ulong handle;
        private bool isDisposed;

        /// <summary>Read a folder that `taichi-soft export` wrote. Compiles its kernels: takes seconds.</summary>
        public Scene(string folder)
        {
            if (Native.ts_version() != Native.Version)
            {
                throw new SoftException(
                    ErrorCode.Version, "the library is of version " + Native.ts_version() + ": give one of version "
                    + Native.Version);
            }
            Native.Check(Native.ts_scene_load(Native.Bytes(folder), out handle), this);
        }

        /// <summary>Unloads it, where nobody has.</summary>
        ~Scene()
        {
            Release();
        }

        /// <summary>Unload it. Its worlds go on.</summary>
        public void Dispose()
        {
            Native.Check(Release(), this);
            GC.SuppressFinalize(this);
        }

        private int Release()
        {
            if (isDisposed || handle == 0) return 0;
            isDisposed = true;
            return Native.ts_scene_unload(handle);
        }

        internal ulong Handle
        {
            get { return handle; }
        }

        /// <summary>How much there is.</summary>
        public SceneInfo GetInfo()
        {
            var info = new SceneInfo { structSize = Size<SceneInfo>.Bytes };
            Native.Check(Native.ts_scene_get_info(handle, ref info), this);
            return info;
        }

        /// <summary>The number of what has a name: of a body, that of its slot.</summary>
        public int Find(NameKind kind, string name)
        {
            int number;
            Native.Check(Native.ts_scene_find(handle, (int)kind, Native.Bytes(name), out number), this);
            return number;
        }

        /// <summary>The name of what has a number.</summary>
        public string GetName(NameKind kind, int number)
        {
            var name = new byte[256];
            int result = Native.ts_scene_get_name(handle, (int)kind, number, name, Native.Length(name));
            while (result == (int)ErrorCode.Size)
            {
                name = new byte[2 * name.Length];
                result = Native.ts_scene_get_name(handle, (int)kind, number, name, Native.Length(name));
            }
            Native.Check(result, this);
            return Encoding.UTF8.GetString(name, 0, Array.IndexOf(name, (byte)0));
        }

        /// <summary>What bodies of an asset have in common.</summary>
        public AssetInfo GetAssetInfo(int asset)
        {
            var info = new AssetInfo { structSize = Size<AssetInfo>.Bytes };
            Native.Check(Native.ts_asset_get_info(handle, asset, ref info), this);
            return info;
        }

        /// <summary>Levels of detail that an asset has; its info is of the finest.</summary>
        public int GetLevelCount(int asset)
        {
            int count;
            Native.Check(Native.ts_asset_get_level_count(handle, asset, out count), this);
            return count;
        }

        /// <summary>The level of detail of bodies that a mesh draws; -1 for every one, as skins do.</summary>
        public int GetMeshLevel(int mesh)
        {
            int level;
            Native.Check(Native.ts_mesh_get_level(handle, mesh, out level), this);
            return level;
        }

        /// <summary>How much a mesh draws.</summary>
        public MeshInfo GetMeshInfo(int mesh)
        {
            var info = new MeshInfo { structSize = Size<MeshInfo>.Bytes };
            Native.Check(Native.ts_mesh_get_info(handle, mesh, ref info), this);
            return info;
        }

        /// <summary>Triangles, 3 numbers each; clockwise seen from outside in Unity's axes.</summary>
        public void GetTriangles(int mesh, int[] indices)
        {
            Native.Check(Native.ts_mesh_get_triangles(handle, mesh, indices, Native.Length(indices)), this);
        }

        /// <summary>Texture coordinates, 2 numbers each, v upwards.</summary>
        public void GetUv(int mesh, float[] uv)
        {
            Native.Check(Native.ts_mesh_get_uv(handle, mesh, uv, Native.Length(uv)), this);
        }
    }

    /// <summary>A scene that moves.</summary>
    public sealed class World : IDisposable
    {
        // The library calls a static method, which is what Unity's IL2CPP can hand out. The delegate is kept here,
        // or the garbage collector would take it; the world is found through a weak handle, or it would live for ever.
        private static readonly Native.BeforeStep onStep = OnStep;

        private readonly ulong handle;
        private readonly PlainEvent[] drained = new PlainEvent[64];
        private readonly ulong[] found; // room for all bodies
        private GCHandle self;
        private bool isDisposed;
        private ExceptionDispatchInfo thrown;

        /// <summary>A world as it was exported.</summary>
        public World(Scene scene)
        {
            found = new ulong[scene.GetInfo().SlotCount];
            Native.Check(Native.ts_world_create(scene.Handle, out handle), scene);
            self = GCHandle.Alloc(this, GCHandleType.Weak);
            Native.Check(Native.ts_world_on_step(handle, onStep, GCHandle.ToIntPtr(self)), this);
        }

        /// <summary>Destroys it, where nobody has.</summary>
        ~World()
        {
            Release();
        }

        /// <summary>Destroy it. Within BeforeStep Advance then throws.</summary>
        public void Dispose()
        {
            Native.Check(Release(), this);
            GC.SuppressFinalize(this);
        }

        private int Release()
        {
            if (isDisposed || handle == 0) return 0;
            int result = Native.ts_world_destroy(handle);
            if (result != 0) return result;
            isDisposed = true;
            if (self.IsAllocated) self.Free();
            return 0;
        }

        /// <summary>Called before each step of Advance: the place to move colliders and frames, and to push.</summary>
        /// <remarks>After one that throws, the rest of this Advance goes without; Advance then throws that.</remarks>
        public Action<World> BeforeStep { get; set; }

        [MonoPInvokeCallback(typeof(Native.BeforeStep))]
        private static void OnStep(ulong handle, IntPtr user)
        {
            var world = GCHandle.FromIntPtr(user).Target as World;
            if (world == null || world.BeforeStep == null || world.thrown != null) return;
            try
            {
                world.BeforeStep(world);
            }
            catch (Exception exception)
            {
                world.thrown = ExceptionDispatchInfo.Capture(exception); // it cannot pass through the library
            }
        }

        /// <summary>How Advance steps: dt [s]; 0 substeps for as many as are stable; time beyond is dropped.</summary>
        public void SetFixedStep(double dt, int substeps = 0, int maxSteps = 8)
        {
            var step = new FixedStep
            {
                structSize = Size<FixedStep>.Bytes, substeps = substeps, maxSteps = maxSteps, dt = dt
            };
            Native.Check(Native.ts_world_set_fixed_step(handle, ref step), this);
        }

        /// <summary>Threads of its own that a step may use, with the one that calls it, 1 to 256: by default as many
        /// as the processor has. What comes out does not depend on it.</summary>
        public void SetThreads(int count)
        {
            Native.Check(Native.ts_world_set_threads(handle, count), this);
        }

        /// <summary>One step of dt [s] in equal parts; 0 chooses as many as are stable.</summary>
        public void Step(double dt, int substeps = 0)
        {
            Native.Check(Native.ts_world_step(handle, dt, substeps), this);
        }

        /// <summary>Put in the time of a frame [s] and make the steps that are due.</summary>
        public Clock Advance(double seconds)
        {
            var clock = new Clock { structSize = Size<Clock>.Bytes };
            int result = Native.ts_world_advance(handle, seconds, ref clock);
            if (thrown != null)
            {
                ExceptionDispatchInfo first = thrown;
                thrown = null;
                first.Throw();
            }
            Native.Check(result, this);
            return clock;
        }

        /// <summary>The time; StepsMade is 0.</summary>
        public Clock GetClock()
        {
            var clock = new Clock { structSize = Size<Clock>.Bytes };
            Native.Check(Native.ts_world_get_clock(handle, ref clock), this);
            return clock;
        }

        /// <summary>The substeps that a step of dt [s] takes now.</summary>
        public int StableSubsteps(double dt)
        {
            int substeps;
            Native.Check(Native.ts_world_stable_substeps(handle, dt, out substeps), this);
            return substeps;
        }

        /// <summary>Wake all bodies.</summary>
        public void Wake()
        {
            Native.Check(Native.ts_world_wake(handle), this);
        }

        /// <summary>Gravity [unit of length/s^2], from the next step on. Who sleeps wakes.</summary>
        public void SetGravity(Vector3d gravity)
        {
            Native.Check(Native.ts_world_set_gravity(handle, ref gravity), this);
        }

        /// <summary>Coulomb's coefficient of the floor, from the next step on.</summary>
        public void SetFriction(double friction)
        {
            Native.Check(Native.ts_world_set_friction(handle, friction), this);
        }

        /// <summary>Wind: its velocity, density of the air [kg/m^3], coefficient of drag.</summary>
        public void SetWind(Vector3d velocity, double density, double drag)
        {
            Native.Check(Native.ts_world_set_wind(handle, ref velocity, density, drag), this);
        }

        /// <summary>Push all within a radius away from a place.</summary>
        public void RadialImpulse(Vector3d center, double impulse, double radius)
        {
            Native.Check(Native.ts_world_radial_impulse(handle, ref center, impulse, radius), this);
        }

        /// <summary>A number that tells states apart: that of Python's world in the same state.</summary>
        public ulong Hash()
        {
            ulong hash;
            Native.Check(Native.ts_world_hash(handle, out hash), this);
            return hash;
        }

        /// <summary>Bytes that Snapshot needs now; more with contacts that are recorded, grabs, and what hangs.</summary>
        public int SnapshotSize()
        {
            UIntPtr size;
            Native.Check(Native.ts_world_snapshot(handle, null, UIntPtr.Zero, out size), this);
            return checked((int)size.ToUInt64());
        }

        /// <summary>Write the state into a buffer of at least SnapshotSize bytes. Returns: how many are used.</summary>
        public int Snapshot(byte[] buffer)
        {
            UIntPtr size;
            if (buffer == null) throw new ArgumentNullException("buffer");
            Native.Check(Native.ts_world_snapshot(handle, buffer, Native.Length(buffer), out size), this);
            return checked((int)size.ToUInt64());
        }

        /// <summary>The state as bytes.</summary>
        public byte[] Snapshot()
        {
            var buffer = new byte[SnapshotSize()];
            Snapshot(buffer);
            return buffer;
        }

        /// <summary>Back to a state.</summary>
        public void Restore(byte[] bytes)
        {
            Native.Check(Native.ts_world_restore(handle, bytes, Native.Length(bytes)), this);
        }

        /// <summary>Back to a state, in the first bytes of a buffer.</summary>
        public void Restore(byte[] buffer, int size)
        {
            if (buffer == null || size < 0 || size > buffer.Length) throw new ArgumentOutOfRangeException("size");
            Native.Check(Native.ts_world_restore(handle, buffer, new UIntPtr((uint)size)), this);
        }

        /// <summary>Record events of these kinds, and no others, from the next step on; 0 for none.</summary>
        /// <remarks>What touches already counts as a contact that begins in that step.</remarks>
        public void RecordEvents(EventKinds kinds)
        {
            Native.Check(Native.ts_world_record_events(handle, (int)kinds), this);
        }

        /// <summary>Take the oldest that wait, as many as there is room for. Returns: how many.</summary>
        public int DrainEvents(SoftEvent[] events)
        {
            if (events == null) throw new ArgumentNullException("events");
            int made = 0;
            while (made < events.Length)
            {
                UIntPtr size;
                int room = Math.Min(drained.Length, events.Length - made);
                Native.Check(
                    Native.ts_world_drain_events(
                        handle, ref drained[0], new UIntPtr(Size<PlainEvent>.Bytes), new UIntPtr((uint)room), out size),
                    this);
                int count = (int)size.ToUInt64();
                for (int i = 0; i < count; ++i) events[made + i] = new SoftEvent(this, ref drained[i]);
                made += count;
                if (count < room) break;
            }
            return made;
        }

        /// <summary>How many were dropped so far, as too many waited.</summary>
        public long DroppedEvents()
        {
            long count;
            Native.Check(Native.ts_world_dropped_events(handle, out count), this);
            return count;
        }

        /// <summary>Put a body into a free slot of its asset.</summary>
        public Body Spawn(int asset, Placement place)
        {
            ulong body;
            place.structSize = Size<Placement>.Bytes;
            Native.Check(Native.ts_world_spawn(handle, asset, ref place, out body), this);
            return new Body(this, body);
        }

        /// <summary>Who lives in a slot; one that is not there, for nobody.</summary>
        public Body GetBody(int slot)
        {
            ulong body;
            Native.Check(Native.ts_world_get_body(handle, slot, out body), this);
            return new Body(this, body);
        }

        /// <summary>The first surface on a ray, back faces left out; false where there is none.</summary>
        public bool Raycast(Vector3d origin, Vector3d direction, double maxDistance, out Hit hit, out Body body)
        {
            hit = new Hit { structSize = Size<Hit>.Bytes };
            Native.Check(Native.ts_world_raycast(handle, ref origin, ref direction, maxDistance, ref hit), this);
            body = new Body(this, hit.body);
            return hit.body != 0;
        }

        /// <summary>The nearest point of all surfaces; false where none is near enough.</summary>
        public bool Closest(Vector3d point, double maxDistance, out Hit hit, out Body body)
        {
            hit = new Hit { structSize = Size<Hit>.Bytes };
            Native.Check(Native.ts_world_closest(handle, ref point, maxDistance, ref hit), this);
            body = new Body(this, hit.body);
            return hit.body != 0;
        }

        /// <summary>Bodies that touch a sphere, or enclose it, by slot. Returns: how many.</summary>
        /// <remarks>Room for as many bodies as there are slots is always enough.</remarks>
        public int OverlapSphere(Vector3d center, double radius, Body[] bodies)
        {
            UIntPtr count;
            Native.Check(
                Native.ts_world_overlap_sphere(handle, ref center, radius, found, RoomOf(bodies), out count), this);
            return Copy(count, bodies);
        }

        /// <summary>The same for a box with edges of a size.</summary>
        public int OverlapBox(Pose pose, Vector3d size, Body[] bodies)
        {
            UIntPtr count;
            Native.Check(
                Native.ts_world_overlap_box(handle, ref pose, ref size, found, RoomOf(bodies), out count), this);
            return Copy(count, bodies);
        }

        private UIntPtr RoomOf(Body[] bodies)
        {
            if (bodies == null) throw new ArgumentNullException("bodies");
            return new UIntPtr((uint)Math.Min(bodies.Length, found.Length));
        }

        private int Copy(UIntPtr size, Body[] bodies)
        {
            int count = (int)size.ToUInt64();
            for (int i = 0; i < count; ++i) bodies[i] = new Body(this, found[i]);
            return count;
        }

        /// <summary>The grab with a number from 0 to 15; one that is not there, for none.</summary>
        /// <remarks>Grabs of the exported world are there, too.</remarks>
        public Grab GetGrab(int number)
        {
            ulong grab;
            Native.Check(Native.ts_world_get_grab(handle, number, out grab), this);
            return new Grab(this, grab);
        }

        /// <summary>The joint with a number from 0 to 63; one that is not there, for none.</summary>
        public Joint GetJoint(int number)
        {
            ulong joint;
            Native.Check(Native.ts_world_get_joint(handle, number, out joint), this);
            return new Joint(this, joint);
        }

        /// <summary>The motor with a number from 0 to 63; one that is not there, for none.</summary>
        public Motor GetMotor(int number)
        {
            ulong motor;
            Native.Check(Native.ts_world_get_motor(handle, number, out motor), this);
            return new Motor(this, motor);
        }

        /// <summary>A new one, where the world was made with room for it. Returns its number.</summary>
        public int AddCollider(Shape shape, Pose pose)
        {
            int collider;
            shape.structSize = Size<Shape>.Bytes;
            Native.Check(Native.ts_collider_add(handle, ref shape, ref pose, out collider), this);
            return collider;
        }

        /// <summary>Take it out of the world.</summary>
        public void RemoveCollider(int collider)
        {
            Native.Check(Native.ts_collider_remove(handle, collider), this);
        }

        /// <summary>Be there at the end of the coming step, and push who is in the way.</summary>
        public void MoveCollider(int collider, Pose pose)
        {
            Native.Check(Native.ts_collider_move_to(handle, collider, ref pose), this);
        }

        /// <summary>Move on by itself: velocity, and spin [rad/s].</summary>
        public void SetColliderVelocity(int collider, Vector3d linear, Vector3d spin)
        {
            Native.Check(Native.ts_collider_set_velocity(handle, collider, ref linear, ref spin), this);
        }

        /// <summary>Be there at once, and push nobody.</summary>
        public void TeleportCollider(int collider, Pose pose)
        {
            Native.Check(Native.ts_collider_teleport(handle, collider, ref pose), this);
        }

        /// <summary>Coulomb's coefficient of a collider, from the next step on.</summary>
        public void SetColliderFriction(int collider, double friction)
        {
            Native.Check(Native.ts_collider_set_friction(handle, collider, friction), this);
        }

        /// <summary>Where a collider is.</summary>
        public Pose GetColliderPose(int collider)
        {
            Pose pose;
            Native.Check(Native.ts_collider_get_pose(handle, collider, out pose), this);
            return pose;
        }

        /// <summary>What bodies gave it in the last step, and the moment of that about its place.</summary>
        public void GetColliderImpulse(int collider, out Vector3d impulse, out Vector3d moment)
        {
            Native.Check(Native.ts_collider_get_impulse(handle, collider, out impulse, out moment), this);
        }

        /// <summary>A place that moves as the game says: a bone, a vehicle, a hand. Returns its number.</summary>
        public int AddFrame(Pose pose)
        {
            int frame;
            Native.Check(Native.ts_frame_add(handle, ref pose, out frame), this);
            return frame;
        }

        /// <summary>Take it out of the world. What hangs from it is let go.</summary>
        public void RemoveFrame(int frame)
        {
            Native.Check(Native.ts_frame_remove(handle, frame), this);
        }

        /// <summary>Where a frame is.</summary>
        public Pose GetFramePose(int frame)
        {
            Pose pose;
            Native.Check(Native.ts_frame_get_pose(handle, frame, out pose), this);
            return pose;
        }

        /// <summary>Be there at the end of the coming step, with what is attached.</summary>
        public void MoveFrame(int frame, Pose pose)
        {
            Native.Check(Native.ts_frame_move_to(handle, frame, ref pose), this);
        }

        internal ulong Handle
        {
            get { return handle; }
        }
    }

    /// <summary>A body of a world. Another one that comes into its slot later is another Body.</summary>
    public struct Body
    {
        private readonly World world;

        /// <summary>The library's number; 0 is nobody.</summary>
        public readonly ulong Id;

        internal Body(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>Whether there was anybody in the slot.</summary>
        public bool IsSomebody
        {
            get { return Id != 0; }
        }

        /// <summary>Whether it is in the world still.</summary>
        public bool IsAlive
        {
            get
            {
                int status;
                if (Id == 0) return false;
                int result = Native.ts_body_get_status(World.Handle, Id, out status);
                if (result == (int)ErrorCode.Handle) return false;
                Check(result);
                return true;
            }
        }

        /// <summary>Where it lives.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this body is of no world");
                return world;
            }
        }

        private void Check(int result)
        {
            Native.Check(result, world);
        }

        /// <summary>Take it out of the world.</summary>
        public void Despawn()
        {
            Check(Native.ts_world_despawn(World.Handle, Id));
        }

        /// <summary>The number of its asset.</summary>
        public int GetAsset()
        {
            int asset;
            Check(Native.ts_body_get_asset(World.Handle, Id, out asset));
            return asset;
        }

        /// <summary>How it fares.</summary>
        public BodyStatus GetStatus()
        {
            int status;
            Check(Native.ts_body_get_status(World.Handle, Id, out status));
            return (BodyStatus)status;
        }

        /// <summary>Its level of detail, 0 being the finest.</summary>
        public int Level
        {
            get
            {
                int level;
                Check(Native.ts_body_get_level(World.Handle, Id, out level));
                return level;
            }
        }

        /// <summary>Vertices that it has at its level.</summary>
        public int VertexCount
        {
            get
            {
                int count;
                Check(Native.ts_body_get_vertex_count(World.Handle, Id, out count));
                return count;
            }
        }

        /// <summary>Go on with more or fewer tetrahedra: its vertices and triangles are others then.</summary>
        /// <remarks>Joints, motors and attachments that have no place there bar that, unless they are released.</remarks>
        public void SetLevel(int level, bool release = false)
        {
            Check(Native.ts_body_set_level(World.Handle, Id, level, release ? 1 : 0));
        }

        /// <summary>Of its vertices, 3 numbers each; with alpha below 1 on the way from the step before.</summary>
        public void ReadPositions(double alpha, float[] positions)
        {
            Check(Native.ts_body_positions(World.Handle, Id, alpha, positions, Native.Length(positions)));
        }

        /// <summary>What is drawn, Clock.Alpha on the way: places and normals, 3 numbers a vertex each.</summary>
        /// <remarks>Without normals for null.</remarks>
        public void ReadMesh(int mesh, float[] positions, float[] normals)
        {
            if (normals != null && positions != null && normals.Length != positions.Length)
            {
                throw new SoftException(
                    ErrorCode.Size, "normals has room for " + normals.Length + " numbers: give room for "
                    + positions.Length);
            }
            Check(Native.ts_body_mesh(World.Handle, Id, mesh, positions, normals, Native.Length(positions)));
        }

        /// <summary>The same into memory that does not move, such as a pinned Vector3[] of an engine.</summary>
        /// <remarks>The caller answers for `count` numbers of room at both; without normals for IntPtr.Zero.</remarks>
        public void ReadMesh(int mesh, IntPtr positions, IntPtr normals, int count)
        {
            if (count < 0) throw new ArgumentOutOfRangeException("count");
            Check(Native.ts_body_mesh(World.Handle, Id, mesh, positions, normals, new UIntPtr((uint)count)));
        }

        /// <summary>Its centre of mass.</summary>
        public Vector3d GetCenter()
        {
            Vector3d center;
            Check(Native.ts_body_center(World.Handle, Id, out center));
            return center;
        }

        /// <summary>Of the centre of mass, and spin about it [rad/s].</summary>
        public void SetVelocity(Vector3d linear, Vector3d spin)
        {
            Check(Native.ts_body_set_velocity(World.Handle, Id, ref linear, ref spin));
        }

        /// <summary>The centre of mass to a place, turned about it, with its velocity or at rest.</summary>
        public void Teleport(Vector3d center, Quaterniond turn, bool keepsVelocity = false)
        {
            Check(Native.ts_body_teleport(World.Handle, Id, ref center, ref turn, keepsVelocity ? 1 : 0));
        }

        /// <summary>On a list of vertices together; null stands for all.</summary>
        public void ApplyImpulse(Vector3d impulse, int[] vertices = null)
        {
            Check(Native.ts_body_apply_impulse(World.Handle, Id, ref impulse, vertices, Native.Count(vertices)));
        }

        /// <summary>Throughout the coming step, on a list of vertices together; null stands for all.</summary>
        public void ApplyForce(Vector3d force, int[] vertices = null)
        {
            Check(Native.ts_body_apply_force(World.Handle, Id, ref force, vertices, Native.Count(vertices)));
        }

        /// <summary>On the vertices within a radius of a place.</summary>
        public void ImpulseAt(Vector3d impulse, Vector3d point, double radius)
        {
            Check(Native.ts_body_impulse_at(World.Handle, Id, ref impulse, ref point, radius));
        }

        /// <summary>1 is the world's gravity, 0 none.</summary>
        public void SetGravityScale(double scale)
        {
            Check(Native.ts_body_set_gravity_scale(World.Handle, Id, scale));
        }

        /// <summary>Coulomb's coefficient against other bodies, in worlds with soft contact.</summary>
        public void SetFriction(double friction)
        {
            Check(Native.ts_body_set_friction(World.Handle, Id, friction));
        }

        /// <summary>How fast it loses its velocity [1/s].</summary>
        public void SetDamping(double rate)
        {
            Check(Native.ts_body_set_damping(World.Handle, Id, rate));
        }

        /// <summary>Whether it is out of the wind.</summary>
        public void SetSheltered(bool isSheltered)
        {
            Check(Native.ts_body_set_sheltered(World.Handle, Id, isSheltered ? 1 : 0));
        }

        /// <summary>Hold vertices where they are.</summary>
        public void Pin(int[] vertices)
        {
            Check(Native.ts_body_pin(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Let go of vertices; null stands for all.</summary>
        public void Unpin(int[] vertices = null)
        {
            Check(Native.ts_body_unpin(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Where pinned vertices are after the coming step, 3 numbers each.</summary>
        public void SetTargets(int[] vertices, float[] targets)
        {
            int needed = vertices == null ? 0 : 3 * vertices.Length;
            if (targets != null && targets.Length != needed)
            {
                throw new SoftException(
                    ErrorCode.Size, "targets has " + targets.Length + " numbers: give " + needed);
            }
            Check(Native.ts_body_set_targets(World.Handle, Id, vertices, Native.Count(vertices), targets));
        }

        /// <summary>Let vertices go with a frame, from where both are now.</summary>
        /// <remarks>`feels`: GetLoad is asked later.</remarks>
        public void Attach(int[] vertices, int frame, bool feels = false)
        {
            Check(Native.ts_body_attach(World.Handle, Id, vertices, Native.Count(vertices), frame, feels ? 1 : 0));
        }

        /// <summary>Let vertices go that hang from a frame, with their velocity; null stands for all that do.</summary>
        public void Detach(int[] vertices = null)
        {
            Check(Native.ts_body_detach(World.Handle, Id, vertices, Native.Count(vertices)));
        }

        /// <summary>Let vertices be held by another body: where they are in it, or each at a vertex of it.</summary>
        public Joint Join(int[] vertices, Body other, int[] onto = null)
        {
            if (onto != null && (vertices == null || onto.Length != vertices.Length))
            {
                throw new SoftException(ErrorCode.Size, "onto names a vertex for each of vertices");
            }
            ulong joint;
            Check(Native.ts_body_join(World.Handle, Id, vertices, Native.Count(vertices), other.Id, onto, out joint));
            return new Joint(World, joint);
        }

        /// <summary>Turn vertices, or push them.</summary>
        public Motor AddMotor(int[] vertices, Drive drive)
        {
            ulong motor;
            drive.structSize = Size<Drive>.Bytes;
            Check(
                Native.ts_body_add_motor(World.Handle, Id, vertices, Native.Count(vertices), ref drive, out motor));
            return new Motor(World, motor);
        }

        /// <summary>What it pulled a frame with, mean over the last step, and the torque about its origin.</summary>
        public void GetLoad(int frame, out Vector3d force, out Vector3d torque)
        {
            Check(Native.ts_body_get_load(World.Handle, Id, frame, out force, out torque));
        }

        /// <summary>Take hold of its surface. There can be 16 grabs at a time.</summary>
        public Grab Grab(Pull pull)
        {
            ulong grab;
            pull.structSize = Size<Pull>.Bytes;
            Check(Native.ts_body_grab(World.Handle, Id, ref pull, out grab));
            return new Grab(World, grab);
        }
    }

    /// <summary>A hand on a body. Another one that comes later is another Grab.</summary>
    public struct Grab
    {
        private readonly World world;

        /// <summary>The library's number; 0 is none.</summary>
        public readonly ulong Id;

        internal Grab(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>Whether there was any at that number.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>Where it is.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this grab is of no world");
                return world;
            }
        }

        private void Check(int result)
        {
            Native.Check(result, world);
        }

        /// <summary>Pull to another place from the coming step on.</summary>
        public void Move(Vector3d point)
        {
            Check(Native.ts_grab_move(World.Handle, Id, ref point));
        }

        /// <summary>Let go.</summary>
        public void Release()
        {
            Check(Native.ts_grab_release(World.Handle, Id));
        }

        /// <summary>With what it pulls, in the last substep.</summary>
        public Vector3d GetForce()
        {
            Vector3d force;
            Check(Native.ts_grab_get_force(World.Handle, Id, out force));
            return force;
        }
    }

    /// <summary>What holds a part of a body to another one.</summary>
    public struct Joint
    {
        private readonly World world;

        /// <summary>The library's number; 0 is none.</summary>
        public readonly ulong Id;

        internal Joint(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>Whether there was one of its number.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>Where it is.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this joint is of no world");
                return world;
            }
        }

        /// <summary>Let go.</summary>
        public void Release()
        {
            Native.Check(Native.ts_joint_release(World.Handle, Id), world);
        }

        /// <summary>With what the other body pulls, mean over the last step.</summary>
        public Vector3d GetForce()
        {
            Vector3d force;
            Native.Check(Native.ts_joint_get_force(World.Handle, Id, out force), world);
            return force;
        }
    }

    /// <summary>What turns a part of a body, or pushes it.</summary>
    public struct Motor
    {
        private readonly World world;

        /// <summary>The library's number; 0 is none.</summary>
        public readonly ulong Id;

        internal Motor(World world, ulong id)
        {
            this.world = world;
            Id = id;
        }

        /// <summary>Whether there was one of its number.</summary>
        public bool IsThere
        {
            get { return Id != 0; }
        }

        /// <summary>Where it is.</summary>
        public World World
        {
            get
            {
                if (world == null) throw new SoftException(ErrorCode.Handle, "this motor is of no world");
                return world;
            }
        }

        /// <summary>Drive towards another speed.</summary>
        public void SetSpeed(double speed)
        {
            Native.Check(Native.ts_motor_set_speed(World.Handle, Id, speed), world);
        }

        /// <summary>Allow another torque or force; with 0 the vertices coast.</summary>
        public void SetLimit(double limit)
        {
            Native.Check(Native.ts_motor_set_limit(World.Handle, Id, limit), world);
        }

        /// <summary>That its vertices have.</summary>
        public double GetSpeed()
        {
            double speed;
            Native.Check(Native.ts_motor_get_speed(World.Handle, Id, out speed), world);
            return speed;
        }

        /// <summary>Torque or force that it gave, mean over the last step.</summary>
        public double GetEffort()
        {
            double effort;
            Native.Check(Native.ts_motor_get_effort(World.Handle, Id, out effort), world);
            return effort;
        }

        /// <summary>Drive no longer.</summary>
        public void Remove()
        {
            Native.Check(Native.ts_motor_remove(World.Handle, Id), world);
        }
    }

    // Unity's IL2CPP looks for an attribute of this name; it need not be Unity's own.
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
        }
    }

    internal static class Size<T>
    {
        internal static readonly uint Bytes = (uint)Marshal.SizeOf(typeof(T));
    }

    // The functions of taichi_soft.h, by their names. Texts are UTF-8 with a zero at the end, made by Bytes: what
    // .NET makes of a string depends on the system.
    internal static class Native
    {
        internal const uint Version = 1;
        private const string Library = "taichi_soft";
        private const CallingConvention C = CallingConvention.Cdecl;

        [UnmanagedFunctionPointer(C)]
        internal delegate void BeforeStep(ulong world, IntPtr user);

        internal static byte[] Bytes(string text)
        {
            if (text == null) return null;
            if (text.IndexOf('\0') >= 0) throw new SoftException(ErrorCode.Argument, "a zero is in a name or folder");
            return Encoding.UTF8.GetBytes(text + "\0");
        }

        internal static UIntPtr Length(Array array)
        {
            return array == null ? UIntPtr.Zero : new UIntPtr((uint)array.Length);
        }

        // Of a list of vertices. The library takes an empty one for all, which nobody means who counted to 0.
        internal static UIntPtr Count(int[] vertices)
        {
            if (vertices != null && vertices.Length == 0)
            {
                throw new SoftException(ErrorCode.Argument, "no vertex is named: give null for all");
            }
            return Length(vertices);
        }

        // The owner is named so that the garbage collector does not finish it within the call.
        [MethodImpl(MethodImplOptions.NoInlining)]
        internal static void Check(int result, object owner)
        {
            GC.KeepAlive(owner);
            if (result != 0) throw new SoftException((ErrorCode)result, LastError());
        }

        private static string LastError()
        {
            IntPtr text = ts_last_error();
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) ++length;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }

        [DllImport(Library, CallingConvention = C)]
        internal static extern uint ts_version();

        [DllImport(Library, CallingConvention = C)]
        internal static extern IntPtr ts_last_error();

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_load(byte[] folder, out ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_load_linked(byte[] world, UIntPtr size, IntPtr kernels, out ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_unload(ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_get_info(ulong scene, ref SceneInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_find(ulong scene, int kind, byte[] name, out int number);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_scene_get_name(ulong scene, int kind, int number, byte[] name,
            UIntPtr capacity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_asset_get_info(ulong scene, int asset, ref AssetInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_info(ulong scene, int mesh, ref MeshInfo info);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_triangles(ulong scene, int mesh, int[] indices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_uv(ulong scene, int mesh, float[] uv, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_create(ulong scene, out ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_destroy(ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_fixed_step(ulong world, ref FixedStep step);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_on_step(ulong world, BeforeStep function, IntPtr user);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_threads(ulong world, int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_job_system(ulong world, IntPtr function, IntPtr user);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_step(ulong world, double dt, int substeps);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_advance(ulong world, double seconds, ref Clock clock);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_clock(ulong world, ref Clock clock);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_stable_substeps(ulong world, double dt, out int substeps);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_wake(ulong world);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_gravity(ulong world, ref Vector3d gravity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_friction(ulong world, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_set_wind(ulong world, ref Vector3d velocity, double density, double drag);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_radial_impulse(ulong world, ref Vector3d center, double impulse,
            double radius);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_hash(ulong world, out ulong hash);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_snapshot(ulong world, byte[] buffer, UIntPtr capacity, out UIntPtr size);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_restore(ulong world, byte[] bytes, UIntPtr size);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_record_events(ulong world, int kinds);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_drain_events(ulong world, ref PlainEvent events, UIntPtr event_size,
            UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_dropped_events(ulong world, out long count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_spawn(ulong world, int asset, ref Placement place, out ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_despawn(ulong world, ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_body(ulong world, int slot, out ulong body);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_asset(ulong world, ulong body, out int asset);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_status(ulong world, ulong body, out int status);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_level(ulong world, ulong body, int level, int release);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_level(ulong world, ulong body, out int level);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_vertex_count(ulong world, ulong body, out int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_asset_get_level_count(ulong scene, int asset, out int count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_mesh_get_level(ulong scene, int mesh, out int level);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_positions(ulong world, ulong body, double alpha, float[] positions,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_mesh(ulong world, ulong body, int mesh, float[] positions, float[] normals,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_mesh(ulong world, ulong body, int mesh, IntPtr positions, IntPtr normals,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_center(ulong world, ulong body, out Vector3d center);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_velocity(ulong world, ulong body, ref Vector3d linear,
            ref Vector3d spin);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_teleport(ulong world, ulong body, ref Vector3d center, ref Quaterniond turn,
            int keeps_velocity);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_apply_impulse(ulong world, ulong body, ref Vector3d impulse, int[] vertices,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_apply_force(ulong world, ulong body, ref Vector3d force, int[] vertices,
            UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_impulse_at(ulong world, ulong body, ref Vector3d impulse, ref Vector3d point,
            double radius);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_gravity_scale(ulong world, ulong body, double scale);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_friction(ulong world, ulong body, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_damping(ulong world, ulong body, double rate);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_sheltered(ulong world, ulong body, int is_sheltered);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_pin(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_unpin(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_set_targets(ulong world, ulong body, int[] vertices, UIntPtr count,
            float[] targets);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_attach(ulong world, ulong body, int[] vertices, UIntPtr count, int frame,
            int feels);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_detach(ulong world, ulong body, int[] vertices, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_get_load(ulong world, ulong body, int frame, out Vector3d force,
            out Vector3d torque);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_grab(ulong world, ulong body, ref Pull pull, out ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_grab(ulong world, int number, out ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_move(ulong world, ulong grab, ref Vector3d point);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_release(ulong world, ulong grab);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_grab_get_force(ulong world, ulong grab, out Vector3d force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_join(ulong world, ulong body, int[] vertices, UIntPtr count, ulong other,
            int[] onto, out ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_joint(ulong world, int number, out ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_joint_release(ulong world, ulong joint);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_joint_get_force(ulong world, ulong joint, out Vector3d force);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_body_add_motor(ulong world, ulong body, int[] vertices, UIntPtr count,
            ref Drive drive, out ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_get_motor(ulong world, int number, out ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_set_speed(ulong world, ulong motor, double speed);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_set_limit(ulong world, ulong motor, double limit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_remove(ulong world, ulong motor);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_get_speed(ulong world, ulong motor, out double speed);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_motor_get_effort(ulong world, ulong motor, out double effort);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_raycast(ulong world, ref Vector3d origin, ref Vector3d direction,
            double reach, ref Hit hit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_closest(ulong world, ref Vector3d point, double reach, ref Hit hit);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_overlap_sphere(ulong world, ref Vector3d center, double radius,
            ulong[] bodies, UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_world_overlap_box(ulong world, ref Pose pose, ref Vector3d size, ulong[] bodies,
            UIntPtr capacity, out UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_add(ulong world, ref Shape shape, ref Pose pose, out int collider);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_remove(ulong world, int collider);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_move_to(ulong world, int collider, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_velocity(ulong world, int collider, ref Vector3d linear,
            ref Vector3d spin);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_teleport(ulong world, int collider, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_set_friction(ulong world, int collider, double friction);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_get_pose(ulong world, int collider, out Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_collider_get_impulse(ulong world, int collider, out Vector3d impulse,
            out Vector3d moment);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_add(ulong world, ref Pose pose, out int frame);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_remove(ulong world, int frame);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_move_to(ulong world, int frame, ref Pose pose);

        [DllImport(Library, CallingConvention = C)]
        internal static extern int ts_frame_get_pose(ulong world, int frame, out Pose pose);
    }
}
